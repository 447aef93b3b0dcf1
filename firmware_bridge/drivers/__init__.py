"""One file or folder for each board's protocol; each is a `Driver`.

`boards` has a record for each; "Add a motor board" in CONTRIBUTING.md says what else a board needs.
"""

from __future__ import annotations

from typing import Protocol

from firmware_bridge.messages import LinkStatus, State


class Driver(Protocol):
    """The near end of a link to a motor controller or an autopilot.

    All methods return at once: the transport's own thread reads, parses and keeps the newest.
    Commands come only from the safety gate.
    """

    def connect(self, timeout: float) -> None:
        """Open the link, wait for the board, set its watchdog; LinkError after `timeout` [s]."""
        ...

    def state(self) -> State | None:
        """Newest state, or None before the first."""
        ...

    def send(self, v: float, omega: float) -> None:
        """Command forward speed [m/s] and turn rate [rad/s].

        Non-finite values raise ValueError before any byte is written.
        """
        ...

    def stop(self) -> None:
        """Command zero speed, then give the robot back: HOLD mode or released motors."""
        ...

    def health(self) -> LinkStatus:
        """What is known of the other end."""
        ...

    def close(self) -> None:
        """Close the link; idempotent."""
        ...
