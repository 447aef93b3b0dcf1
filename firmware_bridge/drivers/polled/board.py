"""What one kind of board adds to the driver that they share: its frames, and how it is set up."""

from __future__ import annotations

from collections.abc import Hashable


class Board:
    """The questions and commands of one kind of board.

    They run in the driver's thread, but `_feed`, which runs in the transport's.
    """

    board = "board"
    hint = "is it powered and wired, TX to RX?"
    answers_commands = True
    """Whether the board answers commands; they then wait for the reply that is under way, and are
    repeated until answered. Else they go out at once, and zeros a few times more."""

    def _configure(self) -> None:
        """Find the board, stop it, set and check its watchdog; raises NoReply or LinkError."""
        raise NotImplementedError

    def _poll(self, cycle: int) -> None:
        """Ask for counters, speeds and errors once; calls `_moved`."""
        raise NotImplementedError

    def _drive(self, first: float, second: float) -> None:
        """Send the speeds of both channels, in motor turns per second."""
        raise NotImplementedError

    def _release(self) -> None:
        """Let go of the motors, which stand still."""

    def _arm(self) -> None:
        """Take the motors, at zero speed; raises NoReply, or LinkError where the board refuses."""

    def _barrier(self) -> None:
        """Ask what `_poll` never asks first: late replies come before it and are thrown away."""

    def _feed(self, data: bytes, stamp: float) -> None:
        """Take bytes off the link; calls `_exchange.deliver` for each frame."""
        raise NotImplementedError

    def _begin(self, key: Hashable) -> None:
        """Prepare the decoder for the reply to `key`."""

    def _damaged(self) -> int:
        """Bytes that the decoder had to skip."""
        return 0
