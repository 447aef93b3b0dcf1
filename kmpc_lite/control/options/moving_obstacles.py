"""What the robot does about circles that move."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.options.fields import check, moments, radii, seconds, share, shares


@dataclass(frozen=True, slots=True)
class MovingObstacleOptions:
    """How far moving circles are foreseen, and which slower speeds and evasive arcs are tried."""

    look_ahead: float = seconds(4.0)
    """How long circles are taken to keep their velocity [s]."""
    look_step: float = seconds(0.2)
    """Time between two moments at which distances are looked at [s]."""
    clearance: float = radii(0.8)
    """Clearance beyond the problem's margin below which a moving circle is in the way [radii]: a
    robot that lags loses it soon."""
    path_clearance: float = radii(0.4)
    """How much of it a path keeps [radii]."""
    long_look: float = share(3.0)
    """How many times as far evasive arcs are looked along, where some are clear for so long: what
    is clear for now only is pushed along by a circle that follows."""
    speed_scales: tuple[float, ...] = shares(0.6, 0.3, 0.0)
    """Shares of the speed that are tried where the full one is not clear; the first that is clear
    is driven."""
    arc_speeds: tuple[float, ...] = shares(0.0, 0.5, -0.5, 1.0, -1.0)
    """Speeds of the evasive arcs, as shares of the fastest; the first arcs are preferred, since
    they move least."""
    arc_turns: tuple[float, ...] = shares(0.0, 1.0, -1.0)
    """Their rates of turn, as shares of the fastest."""
    arc_times: tuple[float, ...] = moments(1.0, 2.0, 4.0)
    """When the robot stops on them [s]."""
    touch: float = radii(0.001 / 0.15)
    """How deep an evasive arc may lead into the margin of a solid [radii]."""
    switch_clearance: float = radii(0.2)
    """How much more clearance another arc must promise than the one begun [radii]."""

    def __post_init__(self) -> None:
        check(self)
