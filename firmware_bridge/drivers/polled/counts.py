"""Encoder counts of a wheel, as far as a board can count them."""

from __future__ import annotations

import math

from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.messages import ConfigError

INT32 = 2**31
"""Counts, and speeds of boards, are 32-bit numbers."""


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
