"""What the sections of a robot file must not say against each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from firmware_bridge.drivers.boards import BoardEntry
from firmware_bridge.messages import ConfigError
from firmware_bridge.safety.gate_settings import GateSettings, Limits

LOOSE = 1.5
"""The watchdog must be this many control periods long, or one late plan would stop the robot."""


def check_period(period: float, gate: GateSettings) -> None:
    """Refuse a control period [s] that the watchdog could not tell from a dead controller."""
    if LOOSE * period > gate.watchdog:
        raise ConfigError(
            f"control.period: {period:g} s is too long for a watchdog of {gate.watchdog:g} s: "
            f"expected at most {gate.watchdog / LOOSE:.3g} s, or a longer safety.watchdog"
        )


def check_kind(kind: str, board: BoardEntry | None, limits: Limits) -> None:
    """Refuse wheels that a board cannot drive, and a limit that is another's."""
    if board is not None and kind not in board.wheels:
        raise ConfigError(
            f"robot.wheels: {kind}: the driver for {board.label} drives {', '.join(board.wheels)}"
        )
    if limits.v_sideways is not None and kind != "omni":
        raise ConfigError(f"limits.v_sideways: only an omni drives sideways, not {kind} wheels")


def check_wheels(limits: Mapping[str, Any], geometry: Mapping[str, Any]) -> None:
    """Refuse speeds that were asked for and that the wheels cannot have.

    The board would receive less than the controller plans with, and than a log for `kmpc fit` says.
    Both sections are as read.
    """
    top = geometry.get("max_wheel_speed")
    if isinstance(top, bool) or not isinstance(top, int | float):
        return  # the driver's to refuse
    for name in ("v_max", "v_reverse", "v_sideways"):
        speed = limits.get(name, 0.0)
        if speed > top:
            raise ConfigError(
                f"limits.{name}: {speed:g} m/s is more than geometry.max_wheel_speed, {top:g} m/s"
            )
