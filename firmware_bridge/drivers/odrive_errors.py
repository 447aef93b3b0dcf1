"""Error registers of ODrive axes, by firmware, and what their bits mean."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

AXIS_ERRORS = {
    0x1: "invalid state",
    0x40: "motor failed",
    0x80: "sensorless estimator failed",
    0x100: "encoder failed",
    0x200: "controller failed",
    0x800: "watchdog timer expired",
    0x1000: "min endstop pressed",
    0x2000: "max endstop pressed",
    0x4000: "e-stop requested",
    0x20000: "homing without endstop",
    0x40000: "over-temperature",
    0x80000: "unknown position",
}
"""Bits of `axisN.error`, firmware 0.5."""
ACTIVE_ERRORS = {
    0x1: "initializing",
    0x2: "system level",
    0x4: "timing error",
    0x8: "missing estimate",
    0x10: "bad configuration",
    0x20: "gate driver fault",
    0x40: "missing input",
    0x100: "DC bus over-voltage",
    0x200: "DC bus under-voltage",
    0x400: "DC bus over-current",
    0x800: "DC bus over-regeneration",
    0x1000: "current limit",
    0x2000: "motor over-temperature",
    0x4000: "inverter over-temperature",
    0x8000: "velocity limit",
    0x10000: "position limit",
    0x1000000: "watchdog timer expired",
    0x2000000: "e-stop requested",
    0x4000000: "spinout",
    0x8000000: "brake resistor disarmed",
    0x10000000: "thermistor disconnected",
    0x40000000: "calibration error",
}
"""Bits of `axisN.active_errors`, firmware 0.6."""


@dataclass(frozen=True)
class ErrorRegister:
    """Where a firmware keeps the errors of an axis, and what they mean."""

    name: str
    words: Mapping[int, str]
    watchdog: int
    estimate: int
    """Errors under which position and speed mean nothing."""

    def text(self, errors: int) -> tuple[str, ...]:
        """Say which errors stand."""
        return tuple(
            self.words.get(1 << bit, f"error bit {bit}")
            for bit in range(errors.bit_length())
            if errors >> bit & 1
        )


REGISTERS = (
    ErrorRegister("error", AXIS_ERRORS, 0x800, 0x80 | 0x100 | 0x80000),
    ErrorRegister("active_errors", ACTIVE_ERRORS, 0x1000000, 0x1 | 0x2 | 0x8 | 0x40000000),
)
