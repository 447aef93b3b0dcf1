"""Options of the step itself: what is believed of its inputs, and what of a solver's answer."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, clock_seconds, count, radii, share


@dataclass(frozen=True, slots=True)
class StepOptions:
    """What a step believes, and how it shares out its time."""

    oldest_pose: float = clock_seconds(2.0)
    """Largest `pose_age` accepted [s]: of an older pose nothing follows for the present one."""
    oldest_pose_periods: int = count(1000)
    """The same in periods: each is rolled out in every step."""
    shortest_period: float = clock_seconds(1e-4)
    """Least `dt` of a problem [s]: a ramp of a second would else have more stages than there is
    memory for."""
    longest_period: float = clock_seconds(100.0)
    """Largest `dt` of a problem [s]: what is longer is no control period but a slip of the pen."""
    reach_beyond_plan: float = radii(2.0)
    """Polygons, walls and grids are looked at as far as the fastest plan reaches and this much
    farther [radii]: for margins, and because the pose may be wrong."""
    lookup_distance: float = radii(2.0)
    """Which solids are near is looked up again after the robot has driven this far [radii]."""
    accepted_defect: float = radii(1 / 3)
    """How far the model's prediction may be from the plan over one period [radii, and 0.15 rad a
    radius]. Beyond it the solver linearises again around the plan; if that does not help, the
    plan's commands are rolled out with the model."""
    accepted_depth: float = radii(2 / 15)
    """How deep a plan that was rolled out may cut into an obstacle and still be driven [radii]: the
    next pass mends it."""
    guide_share: float = share(1 / 3)
    """Share of a time budget after which a search for a path is left to the next step."""

    def __post_init__(self) -> None:
        check(self)
