"""One file or folder for each board's protocol; each is a `Driver`.

`boards` has a record for each; "Add a motor board" in CONTRIBUTING.md says what else a board needs.
"""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from firmware_bridge.messages import LinkStatus, State


class Driver(Protocol):
    """The near end of a link to a motor controller or an autopilot.

    All methods return at once: the transport's own thread reads, parses and keeps the newest.
    Commands come only from the safety gate.
    """

    def connect(self, timeout: float) -> None:
        """Open the link, wait for the board, set its watchdog; LinkError after `timeout` [s]."""

    def state(self) -> State | None:
        """Newest state, or None before the first."""

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command forward speed [m/s], turn rate [rad/s], and an omni's speed to the left [m/s].

        Non-finite values raise ValueError before any byte is written.
        """

    def stop(self) -> None:
        """Command zero speed, then give the robot back: HOLD mode or released motors."""

    def health(self) -> LinkStatus:
        """What is known of the other end."""

    def close(self) -> None:
        """Close the link; idempotent."""


@runtime_checkable
class Autopilot(Driver, Protocol):
    """A driver of a board that decides whom it obeys, estimates its pose, and says why it does not.

    `firmware_bridge.sensors.sighted.autopilot_of` finds it beneath sensors.
    """

    def take(self) -> None:
        """Ask for control, again where it was lost or given back."""

    def confirm_frame(self) -> None:
        """Trust the vehicle's frame again, after it was checked on the map."""

    def feed_pose(self, x: float, y: float, theta: float, stamp: float) -> None:
        """Pass on a pose from outside: ENU [m, m, rad] at `time.monotonic()` [s]."""

    def ask_prearm(self) -> None:
        """Ask what keeps it from arming: `refusals` then tells."""

    def refusals(self) -> tuple[str, ...]:
        """Why it would not arm, in its own words, as far as it has said."""

    def warnings(self) -> tuple[str, ...]:
        """What a user should know while the robot drives."""

    def notes(self) -> tuple[str, ...]:
        """Remarks that stop no robot."""
