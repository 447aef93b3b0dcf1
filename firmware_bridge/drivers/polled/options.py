"""What every ``[board]`` section has: how often the board is asked, time-outs, encoder counts."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Protocol

from firmware_bridge.kinematics import Geometry
from firmware_bridge.messages import ConfigError
from firmware_bridge.options import bounded, check


@dataclass(frozen=True, kw_only=True)
class PolledOptions:
    """What the ``[board]`` section of every board that answers requests has."""

    command_timeout: float = bounded(0.05, 10.0, "s", 0.25)
    """The driver itself sends zero speed when the last command is older [s]."""
    poll_hz: float = bounded(5.0, 200.0, "Hz", 50.0)  # rounds of questions per second [Hz]
    reply_timeout: float = bounded(0.01, 1.0, "s", 0.05)  # how long a reply may take [s]

    def __post_init__(self) -> None:
        """Check the ranges."""
        check(self)


class ServoOptions(Protocol):
    """Where a car's servo is, in the board's own unit."""

    @property
    def servo_straight(self) -> float:
        """Steering straight."""

    @property
    def servo_left(self) -> float:
        """Steering left as far as it goes."""


def servo_position(options: ServoOptions, share: float) -> float:
    """Where a servo is to be for a share of the largest steering angle, to the left."""
    return options.servo_straight + share * (options.servo_left - options.servo_straight)


def check_watchdog(command_timeout: float, watchdog: float) -> None:
    """Check that the driver stops the motors before the board's watchdog does.

    Raises
    ------
    ConfigError
        If its time-out is not the shorter one.
    """
    if command_timeout >= watchdog:
        raise ConfigError(
            f"command_timeout: expected less than the watchdog of {watchdog:g} s, "
            f"got {command_timeout:g}"
        )


INT32 = 2**31  # counts, and speeds of boards, are 32-bit numbers


def counts_per_metre(geometry: Geometry, counts_per_turn: float) -> float:
    """Encoder counts per metre that a wheel drives.

    Raises
    ------
    ConfigError
        If the fastest wheel would turn at more counts a second than fit into 32 bits.
    """
    per_metre = counts_per_turn * geometry.gear_ratio / (math.tau * geometry.wheel_radius)
    if geometry.max_wheel_speed * per_metre >= INT32:
        raise ConfigError(
            f"board.counts_per_turn: {counts_per_turn:g} makes speeds past the board's 32 bits"
        )
    return per_metre
