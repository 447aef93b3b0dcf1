"""Options of the step itself: what is believed of its inputs, and what of a solver's answer."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.options.fields import check, count, radii, seconds, share


@dataclass(frozen=True, slots=True)
class StepOptions:
    """What a step believes, and how it shares out its time."""

    oldest_pose: float = seconds(2.0)
    """Largest `pose_age` accepted [s]: of an older pose nothing follows for the present one."""
    oldest_pose_periods: int = count(1000)
    """The same in periods: each is rolled out in every step."""
    shortest_period: float = seconds(1e-4)
    """Least `dt` of a problem [s]: a ramp of a second would else have more stages than there is
    memory for."""
    longest_period: float = seconds(100.0)
    """Largest `dt` of a problem [s]: what is longer is no control period but a slip of the pen."""
    reach_beyond_plan: float = radii(2.0)
    """Polygons, walls and grids count as far as this beyond the reach of the fastest plan [radii]:
    for margins, and for a pose that is not where it was thought."""
    lookup_distance: float = radii(2.0)
    """How far the robot drives before what is near is looked up again [radii]."""
    accepted_defect: float = radii(1 / 3)
    """How far the model may contradict a plan over one period [radii, and 0.15 rad a radius] before
    the solver linearises again where the plan has come to, and before the plan's commands are
    rolled out anew."""
    accepted_depth: float = radii(2 / 15)
    """How deep such a rolled-out plan may cut into an obstacle and still be driven [radii]: the
    next pass mends the rest."""
    guide_share: float = share(1 / 3)
    """Share of a time budget after which a search for a path is left to the next step."""

    def __post_init__(self) -> None:
        check(self)
