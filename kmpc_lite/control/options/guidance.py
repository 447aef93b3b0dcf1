"""How paths around obstacles are found, timed and followed."""

from __future__ import annotations

import math
from dataclasses import dataclass

from kmpc_lite.option_fields import angle, check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class GuidanceOptions:
    """Numbers of the guide that make its robot drive differently."""

    wide_clearance: float = radii(0.4)
    """Clearance beyond the problem's margin that a path keeps where it can [radii]."""
    narrow_clearance: float = radii(0.2)
    """Clearance that is tried where no path keeps the wide one [radii]."""
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
