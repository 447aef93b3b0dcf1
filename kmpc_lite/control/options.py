"""Every number of the controller that someone may want to change, by room, with unit and reason.

Lengths are in robot radii [radii], speeds in shares of the fastest, times in seconds of a robot of
0.15 m and 0.6 m/s: another one takes `NavigationProblem.scale.time` times as long. So the same
options suit a large robot and a small one. Metres stand only where an accuracy is meant, seconds by
the clock where sensors set the pace (`clock_seconds`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields, is_dataclass, replace
from typing import Any

from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError, did_you_mean
from kmpc_lite.option_fields import (
    angle,
    check,
    clock_seconds,
    count,
    group,
    part,
    probability,
    radii,
    seconds,
    share,
    shares,
    switch,
)
from kmpc_lite.scale import UNIT_RADIUS


def unit_length(problem: NavigationProblem) -> float:
    """Metres that one radius stands for [m].

    The robot's, or that of its footprint's circles; the paper's for a point.
    """
    return problem.body_radius or UNIT_RADIUS


def fastest(problem: NavigationProblem) -> tuple[float, float]:
    """Largest speed [m/s] and turn rate [rad/s] that the command bounds allow in any direction."""
    *speeds, turn_rate = (
        max(float(above), -float(below))
        for above, below in zip(problem.u_max, problem.u_min, strict=True)
    )
    return max(speeds), turn_rate


@dataclass(frozen=True, slots=True)
class MarginOptions:
    """How wide margins are."""

    risk: float = probability(0.05)
    """Probability of leaving the tube around a plan within its memory (8 periods) that margins are
    made for. A collision is far rarer: the robot would have to leave the tube towards an obstacle
    that the plan touches, and no later step could correct it."""
    headway: float = radii(0.4)
    """Least margin at the fastest speed [radii], in proportion less below it, and never more than
    the clearance of the path: a floor may begin to slip at any time, and a slip of 0.2 pushes a
    robot aside by half of what it drives in a period."""
    side_margin: float = radii(1 / 15)
    """Margin from the sides of the area [radii]: nothing is hit there, the robot must only not
    creep out."""
    step_risk: float = probability(1e-3)
    """Probability that the error of a single command exceeds what its margin allows for; a tenth of
    it with a model that was corrected while driving."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class PoseOptions:
    """What a robot's motion can do in a period, and how long a pose that jumped is waited for."""

    tolerated: float = radii(1 / 3)
    """A position this near to the predicted one has never jumped [radii]: the margins allow for it.
    """
    tolerated_turn: float = angle(0.1)
    """A heading this near to the predicted one has never jumped [rad]."""
    slip: float = share(1.0)
    """How much more difference slipping wheels may make, as a share of the commanded distance: all
    of it where they slide or spin."""
    weighed: bool = switch(True)
    """Whether measured poses and predicted ones are weighed by their noise."""
    agreement: float = seconds(2.0)
    """Poses that jumped are believed once they have agreed with each other for this long [s], which
    is longer than errors of a second last. Zero: they are believed at once."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class OSQPOptions:
    """Settings of OSQP for one kind of QP, under OSQP's own names."""

    tolerance: float = share(1e-3, zero=False)
    """`eps_abs` and `eps_rel`. The plan is checked by the model after the QP, and corrected in the
    next period."""
    max_iter: int = count(60)
    """What is not solved by then is near enough: later iterations change the command little."""
    rho: float = share(1.0, zero=False)
    """Step size of ADMM, on rows that are scaled to suit it."""
    alpha: float = share(1.4, zero=False)
    """Over-relaxation of ADMM."""
    adaptive_rho: bool = switch(False)
    """Whether `rho` is adapted in a solve. Without that, all solves take nearly the same time."""
    adaptive_rho_interval: int = count(50)
    """Iterations between two adaptations."""
    scaling: int = count(0, least=0)
    """Rounds of scaling. None: the rows are scaled by `NavigationQP`, once for all QPs."""
    check_termination: int = count(10)
    """Iterations between two looks at the residuals."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class SolverOptions:
    """How the nonlinear program is solved."""

    real_time: OSQPOptions = group(OSQPOptions())
    """For the passes of a period. A model with input history, and a robot that turns far in a
    period, get five times the iterations, and an adapted `rho`."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class StepOptions:
    """What a step believes, and how it shares out its time."""

    accepted_defect: float = radii(1 / 3)
    """How far the model's prediction may be from the plan over one period [radii, and 0.15 rad a
    radius]. Beyond it the solver linearises again around the plan; if that does not help, the
    plan's commands are rolled out with the model."""
    guide_share: float = share(1 / 3)
    """Share of a time budget after which a search for a path is left to the next step."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class StopOptions:
    """Which motions to rest are tried, and what clearance they must keep."""

    further_time: float = seconds(0.5)
    """How much of the plan's rest is tried before the brake [s]: a robot that lags may have to
    drive on to stop clear of what it passes."""
    spend_share: float = part(0.25)
    """Share of the present clearance, as far as it is sure, that a motion may use up if that
    clearance is less than the margin: a robot near an obstacle may pass by, one that touches may
    get free."""
    swerve_time: float = seconds(0.3)
    """Longest time for which a moving obstacle may walk in any direction at its speed [s]."""

    def __post_init__(self) -> None:
        check(self)


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


@dataclass(frozen=True, slots=True)
class ObstacleOptions:
    """Largest obstacles, and most of them: more would take seconds, or more memory than there is.

    Polygons and grids are held to them where they are made, all obstacles together in each step,
    which stops the robot where they are too many.
    """

    circles: int = count(1500)
    """Circles of one step."""
    edges: int = count(2000)
    """Edges of all polygons and walls of one step; each polygon counts as the one with the most."""
    polygon_corners: int = count(100)
    """Corners of one polygon."""
    grid_cells: int = count(2**24)
    """Cells of one grid, and of all of one step."""
    grid_runs: int = count(50_000)
    """Runs of occupied cells, along rows or columns as these are fewer, of one grid and of all of
    one step: noise has many, walls have few."""
    scan_beams: int = count(2**14)
    """Beams of one scan."""

    def __post_init__(self) -> None:
        check(self)


USUAL_OBSTACLES = ObstacleOptions()
"""What polygons and grids are held to if nothing else is asked for."""


@dataclass(frozen=True, slots=True)
class SightOptions:
    """How scans become a map of the robot's neighbourhood, and how long it is believed."""

    cell: float = radii(1 / 3, zero=False)
    """Side of a cell of the map [radii]; larger where the scanner is coarser."""
    most_cells: int = count(400, least=20)
    """Most cells along a side of the map: what is farther away is not remembered."""
    memory: float = seconds(120.0, zero=False)
    """How long what is out of sight is remembered [s]: then nothing is known there. Scans, and
    circles that are out of `sensor_range`."""
    passes: int = count(3, most=127)
    """How many scans must pass through a cell that was hit until it counts as free."""
    certainty: float = share(2.0)
    """How many standard deviations of range and pose a surface is taken to be nearer than it was
    seen: a range counts with its neighbours on the same surface."""
    free_at_start: float = radii(0.0)
    """How far from the robot's edge there is nothing where it begins, seen or not [radii]. One with
    corners, and a camera at its front edge, does not see what it must sweep to get away."""
    blind_time: float = clock_seconds(1.0)
    """How long the robot drives on while scans tell nothing new [s, by the clock: scanners have
    their own pace]; then it stops until they do."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """What is believed of sensors that see circles, and of what walks; times are the robot's."""

    noise: float = radii(2 / 15, zero=False)
    """Standard deviation of a seen position along each axis [radii]: 2 cm for a radius of 15 cm, as
    of a leg that a lidar sees one side of."""
    acceleration: float = share(2 / 3, zero=False)
    """Standard deviation of accelerations along each axis, in the robot's fastest speeds a
    second."""
    false_alarm: float = probability(1e-3)
    """Probability that a circle which keeps its velocity is taken for one that does not."""
    coast: float = seconds(1.5)
    """How long a track lasts unseen [s], and at most as long as it was seen."""
    spread: float = share(3.0)
    """Standard deviations of its velocity by which a circle that was seen to move grows, up to the
    robot's radius: whether a pedestrian comes or not must not block the way."""

    begins: float = seconds(0.85)
    """How long a cluster must have left the place where it was to be a pedestrian [s]; a third of
    it where it comes to what was seen to be free."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True)
class ControllerOptions:
    """Every tunable of the controller, by room.

    Examples
    --------
    >>> options = ControllerOptions.from_dict({"guidance": {"lead_time": 0.3}})
    >>> options.guidance.lead_time, options.changed()
    (0.3, {'guidance': {'lead_time': 0.3}})
    """

    guidance: GuidanceOptions = group(GuidanceOptions())
    """How paths are found, timed and followed."""
    goal: GoalOptions = group(GoalOptions())
    """When the robot has arrived."""
    moving_obstacles: MovingObstacleOptions = group(MovingObstacleOptions())
    """What it does about moving obstacles."""
    tracker: TrackerOptions = group(TrackerOptions())
    """When circles count as moving otherwise than told."""
    margins: MarginOptions = group(MarginOptions())
    """How far it stays away for what its model does not know."""
    solver: SolverOptions = group(SolverOptions())
    """How the nonlinear program is solved."""
    stop: StopOptions = group(StopOptions())
    """Which motions to rest are tried, and what is clear."""
    obstacles: ObstacleOptions = group(ObstacleOptions())
    """How many obstacles it looks at."""
    sight: SightOptions = group(SightOptions())
    """What is remembered of scans, and of circles that are told within a range."""
    pose: PoseOptions = group(PoseOptions())
    """When a pose has jumped."""
    step: StepOptions = group(StepOptions())
    """What a step believes, and how it shares out its time."""
    adaptation: AdaptationOptions = group(AdaptationOptions())
    """How fast, and how far, the model is corrected while driving."""

    def __post_init__(self) -> None:
        check(self)

    @classmethod
    def from_dict(cls, tables: Mapping[str, Any]) -> ControllerOptions:
        """Options from tables of a scenario or problem file: ``{room: {option: value}}``.

        Raises
        ------
        ProblemError
            Names the table or the option that is not there, or whose value is wrong.
        """
        made: ControllerOptions = _changed_by(cls(), tables, "options")
        return made

    def changed(self) -> dict[str, Any]:
        """What differs from the defaults, as `from_dict` takes it: kept with a run."""
        return _difference(asdict(self), asdict(type(self)()))


def _changed_by(options: Any, table: Mapping[str, Any], where: str) -> Any:
    """Options (a dataclass) with the values of a table, in which those of a room are a table."""
    known = [f.name for f in fields(options)]
    values: dict[str, Any] = {}
    for name, value in table.items():
        place = f"{where}.{name}"
        if name not in known:
            hint = did_you_mean(name, known) or f"; expected one of {', '.join(known)}"
            raise ProblemError(f"{place}: unknown{hint}")
        before = getattr(options, name)
        if is_dataclass(before):
            if not isinstance(value, Mapping):
                raise ProblemError(f"{place}: expected a table, got {value!r}")
            values[name] = _changed_by(before, value, place)
        else:
            values[name] = tuple(value) if isinstance(value, list) else value
    try:
        return replace(options, **values)
    except ProblemError as error:
        raise ProblemError(f"{where}: {error}") from error


def _difference(own: dict[str, Any], usual: dict[str, Any]) -> dict[str, Any]:
    """Entries of a table that are others than in another one, table by table."""
    found: dict[str, Any] = {}
    for name, value in own.items():
        if isinstance(value, dict):
            value = _difference(value, usual[name])
            if value:
                found[name] = value
        elif value != usual[name]:
            found[name] = value
    return found
