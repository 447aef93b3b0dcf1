"""What the robot does about circles that move."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, moments, radii, seconds, share, shares


@dataclass(frozen=True, slots=True)
class MovingObstacleOptions:
    """How far moving circles are foreseen, and which slower speeds and evasive arcs are tried."""

    look_ahead: float = seconds(4.0)
    """How long circles are taken to keep their velocity [s]."""
    look_step: float = seconds(0.2, zero=False)
    """Time between two moments at which distances are looked at [s]."""
    clearance: float = radii(0.8)
    """A moving circle is in the way where it comes nearer than this, beyond the problem's margin
    [radii]: a robot that lags loses this much soon."""
    path_clearance: float = radii(0.4)
    """How much of this clearance paths keep [radii]."""
    long_look: float = share(3.0)
    """Evasive arcs are first looked at this many times as far ahead, and those that are clear for
    so long are preferred: on others a circle that follows would push the robot along."""
    speed_scales: tuple[float, ...] = shares(0.6, 0.3, 0.0)
    """Shares of the speed that are tried where the full one is not clear; the first that is clear
    is driven."""
    arc_speeds: tuple[float, ...] = shares(0.0, 0.5, -0.5, 1.0, -1.0)
    """Speeds of the evasive arcs, as shares of the fastest; the first arcs are preferred, since
    they move least."""
    arc_turns: tuple[float, ...] = shares(0.0, 1.0, -1.0)
    """Their rates of turn, as shares of the fastest."""
    arc_times: tuple[float, ...] = moments(1.0, 2.0, 4.0)
    """How long the robot drives on them before it stops [s]."""
    touch: float = radii(0.001 / 0.15)
    """How far an evasive arc may lead into the margin of a solid, or out of the area [radii]."""
    switch_clearance: float = radii(0.2)
    """The robot leaves the arc that it is on for another one only where that promises this much
    more clearance [radii]."""

    def __post_init__(self) -> None:
        check(self)
