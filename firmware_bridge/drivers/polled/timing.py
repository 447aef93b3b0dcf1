"""How often a board is asked and how long it is waited for: what every ``[board]`` section has."""

from __future__ import annotations

import math
from typing import Protocol

from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.messages import ConfigError

INT32 = 2**31
"""Speeds of boards are 32-bit numbers."""


class Timing(Protocol):
    """Options of a board that its driver's thread needs."""

    @property
    def poll_hz(self) -> float:
        """Rounds of questions per second [Hz]."""
        ...

    @property
    def reply_timeout(self) -> float:
        """How long a reply may take [s]."""
        ...

    @property
    def command_timeout(self) -> float:
        """The driver itself sends zero speed when the last command is older [s]."""
        ...


def check_watchdog(command_timeout: float, watchdog: float) -> None:
    """Check that the driver stops the motors before the board's watchdog does.

    Raises
    ------
    ConfigError
        Where its time-out is not the shorter one.
    """
    if command_timeout >= watchdog:
        raise ConfigError(
            f"command_timeout: expected less than the watchdog of {watchdog:g} s, "
            f"got {command_timeout:g}"
        )


def counts_per_metre(geometry: WheelGeometry, counts_per_turn: float) -> float:
    """Encoder counts per metre that a wheel drives.

    Raises
    ------
    ConfigError
        Where the fastest wheel would turn at more counts a second than fit into 32 bits.
    """
    per_metre = counts_per_turn * geometry.gear_ratio / (math.tau * geometry.wheel_radius)
    if geometry.max_wheel_speed * per_metre >= INT32:
        raise ConfigError(
            f"board.counts_per_turn: {counts_per_turn:g} makes speeds past the board's 32 bits"
        )
    return per_metre
