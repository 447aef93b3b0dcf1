"""What the robot does about circles that move."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, radii, seconds, shares


@dataclass(frozen=True, slots=True)
class MovingObstacleOptions:
    """How far moving circles are foreseen, and which slower speeds and evasive arcs are tried."""

    look_ahead: float = seconds(4.0)
    """How long circles are taken to keep their velocity [s]."""
    clearance: float = radii(0.8)
    """A moving circle is in the way where it comes nearer than this, beyond the problem's margin
    [radii]: a robot that lags loses this much soon."""
    speed_scales: tuple[float, ...] = shares(0.6, 0.3, 0.0)
    """Shares of the speed that are tried where the full one is not clear; the first that is clear
    is driven."""

    def __post_init__(self) -> None:
        check(self)
