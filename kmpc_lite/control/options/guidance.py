"""Options of guidance: paths, goals, and circles that move."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, count, radii, seconds, share, shares


@dataclass(frozen=True, slots=True)
class GuidanceOptions:
    """Numbers of the guide that make its robot drive differently."""

    wide_clearance: float = radii(0.4)
    """Clearance beyond the problem's margin that a path keeps where it can [radii]."""
    narrow_clearance: float = radii(0.2)
    """Clearance that is tried if no path keeps the wide one [radii]."""
    switch_time: float = seconds(0.5)
    """A path that passes an obstacle on another side than before is taken only where it is quicker
    by this time [s] ..."""
    switch_share: float = share(0.1)
    """... plus this share of its own time."""
    narrow_cost: float = share(1.0)
    """A path that keeps less than the wide clearance counts as longer by this share: the robot
    drives it more slowly."""
    unknown_cost: float = share(0.2)
    """What scans have not shown of a path counts as longer by this share: the robot may have to
    return."""
    lead_time: float = seconds(0.2)
    """How far the reference runs ahead of the robot [s]."""
    turn_share: float = share(0.9, zero=False)
    """Share of the fastest turn rate at which paths are timed: the rest is left for corrections."""
    brake_share: float = share(0.6)
    """Share of `du_max` with which the reference brakes before the goal: turning takes the rest,
    and what brakes with all of it has nothing left for an error."""
    free_turn: float = angle(math.pi / 3)
    """How much of the first turn the robot makes while it drives, on a long path far from obstacles
    [rad]."""
    replan_interval: float = seconds(0.3)
    """Least time between two searches for the same map and goal [s]."""
    stall_time: float = seconds(5.0)
    """A robot without progress for so long has stalled: it tries a path on another side of some
    obstacle, and the next time one that keeps less clearance. Without progress for as long again,
    the guidance says that it waits [s]."""
    hurried_parts: int = count(3)
    """Most parts of a search that are done in one step while the robot has a path."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class GoalOptions:
    """Tolerances of the goal checker for a pose with little noise; noise widens them."""

    enter_distance: float = radii(0.09)
    """A robot that is nearer to its goal than this [radii] ..."""
    enter_angle: float = angle(0.025)
    """... with a smaller error of its heading than this [rad] has arrived."""
    leave_distance: float = radii(0.1)
    """A robot that had arrived drives again when its averaged pose is farther from the goal than
    this [radii] ..."""
    leave_angle: float = angle(0.05)
    """... or when the averaged heading is wrong by more than this [rad] ..."""
    pushed_distance: float = radii(0.05 / 0.15)
    """... or when one single pose is farther away than this: it was pushed [radii] ..."""
    pushed_angle: float = angle(0.15)
    """... or when one single heading is wrong by more than this [rad]."""
    averaging_time: float = seconds(0.5, zero=False)
    """Memory of the averaged pose [s]: a robot at rest averages its noise away."""

    def __post_init__(self) -> None:
        check(self)


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
