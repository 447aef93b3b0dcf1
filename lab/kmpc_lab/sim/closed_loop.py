"""Drive a controller on a plant, and look at every quarter of a period for a collision.

Every simulated drive goes through one loop: plan from the pose, move, look, go on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.runtime.navigator import Route
from firmware_bridge.runtime.session import ended_words
from kmpc_lab.sim.plants.plant import Plant, scenario_plant
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lab.sim.lidar import Lidar

SUBSAMPLES = 4
HELD = 1.0
"""A goal of a route is held once the robot is within its tolerances for so long [s], or when the
controller says so."""
Watch = Callable[[float, Array, Any, Plan], None]
"""Is called with each step: its time [s], the measured pose, the obstacles, and the plan."""


class Period(NamedTuple):
    """What happened in one period."""

    number: int  # from 0
    plan: Plan  # whose command was driven
    poses: Array
    """(S, 3) true poses during the period, without the first; the next one begins at the last."""


def periods(
    step: Callable[[Array, int], Plan],
    move: Callable[[Array, Array], Array],
    start: Array,
    most: int,
) -> Iterator[Period]:
    """Drive period by period, until whoever looks on has seen enough.

    `step`: plans from the true pose (3,) in a period, by its number; what is measured of the pose,
    and seen of the obstacles, is its own affair. `move`: gives the poses (S, 3) to which a command
    (2,) leads from a pose (3,). `start`: where the robot stands (3,). `most`: periods after which
    the drive ends.

    Examples
    --------
    >>> from kmpc_lite import Controller, nominal_unicycle
    >>> from kmpc_lab.sim.plants.robots import DifferentialDrive
    >>> import numpy as np
    >>> robot, controller = DifferentialDrive(), Controller(nominal_unicycle(0.1))
    >>> for number, plan, poses in periods(
    ...     lambda pose, number: controller.step(pose, goal=(1.0, 0.0, 0.0)),
    ...     lambda pose, command: robot.trace(pose, command, 0.1, 4),
    ...     np.zeros(3),
    ...     most=100,
    ... ):
    ...     if plan.holding:
    ...         break
    >>> bool(np.hypot(*(poses[-1, :2] - (1.0, 0.0))) < 0.02)
    True
    """
    pose = start
    for number in range(most):
        plan = step(pose, number)
        poses = move(pose, plan.command)
        pose = poses[-1]
        yield Period(number, plan, poses)


class Outcome(Enum):
    """How a drive ended."""

    REACHED = "reached"
    COLLISION = "collision"
    TIMEOUT = "timeout"


def why_not(
    outcome: Outcome, scenario: Scenario, route: Route, plan: Plan, x: Array, duration: float
) -> dict[str, Any]:
    """Say in one sentence why a drive that ended at a state (3,) did not arrive; else nothing."""
    if outcome is Outcome.REACHED:
        return {}
    goal = np.array(route.goal)
    errors = float(distances(x, goal)), abs(wrap(float(x[2]) - goal[2]))
    if outcome is Outcome.COLLISION:
        return {"ended": ended_words("touched an obstacle", duration, errors, route.words, ())}
    reason = plan.reason or "the robot was still driving"
    if plan.holding:
        reason = (
            f"the robot holds, but arrived means within {scenario.tolerance:g} m and "
            f"{scenario.heading_tolerance:g} rad"
        )
    return {"ended": ended_words("time is up", duration, errors, route.words, (reason,))}


class Steps(Protocol):
    """Whatever plans one period: our controller, and its peers."""

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: Any = ()) -> Plan:
        """Plan from a pose."""


@dataclass(frozen=True, eq=False)
class Run:
    """A drive, period by period; T periods of S sub-samples."""

    scenario: Scenario
    dt: float
    outcome: Outcome
    duration: float
    """Until the end of the drive [s]; of a collision, to the sub-sample."""
    states: Array
    """(T + 1, 3) true poses at the period's beginning, and the last one."""
    path: Array
    """(T S + 1, 3) true poses at every sub-sample."""
    inputs: Array
    """(T, 2) commands."""
    plans: Array
    """(T, N + 1, 3) what was planned."""
    statuses: tuple[str, ...]
    """(T,) names of `PlanStatus`."""
    step_times: Array
    """(T,) time of each `Controller.step` [s]."""
    clearance: float
    """Smallest distance between the edges of robot and obstacles [m]; negative in a collision."""
    info: dict[str, Any] = field(default_factory=dict)
    """What the caller wants to keep with the run; values that JSON can hold."""
    details: Details | None = None
    """What lay behind each step, where it was recorded."""
    scans: tuple[tuple[float, LaserScan], ...] = ()
    """What a simulated lidar saw: the ends of its turns [s], and their scans."""
    errors: tuple[float, float] | None = None
    """Distance [m] and heading error [rad] to the goal as a real drive reported them once the robot
    had come to rest; None: those of the last state."""

    @property
    def position_error(self) -> float:
        """Distance to the goal at the end [m]."""
        if self.errors is not None:
            return self.errors[0]
        return float(distances(self.states[-1], np.array(self.scenario.goal)))

    @property
    def heading_error(self) -> float:
        """Heading error at the end [rad]."""
        if self.errors is not None:
            return self.errors[1]
        return abs(wrap(float(self.states[-1, 2]) - self.scenario.goal[2]))

    @property
    def arrival(self) -> float | None:
        """First time at which the robot is within both tolerances of the goal [s]."""
        there = self.scenario.arrival.met(self.states, np.array(self.scenario.goal))
        return float(np.argmax(there) * self.dt) if there.any() else None

    def summary(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        times = 1e3 * self.step_times
        return {
            "scenario": self.scenario.name,
            "outcome": self.outcome.value,
            "duration_s": round(self.duration, 6),
            "position_error_m": self.position_error,
            "heading_error_rad": self.heading_error,
            "clearance_m": self.clearance if np.isfinite(self.clearance) else None,
            "step_ms": {
                "p50": float(np.median(times)),
                "p99": float(np.quantile(times, 0.99)),
                "max": float(times.max()),
            },
            "statuses": {
                s.name: self.statuses.count(s.name) for s in PlanStatus if s.name in self.statuses
            },
            **self.info,
        }


def drive(
    controller: Steps,
    scenario: Scenario,
    plant: Plant | None = None,
    dt: float = 0.1,
    settle: float = 0.0,
    stop_norm: float | None = None,
    info: dict[str, Any] | None = None,
    watch: Watch | None = None,
    lidar: Lidar | None = None,
) -> Run:
    """Drive a scenario to its end: arrived, collided, or out of time.

    Parameters
    ----------
    controller : Steps
        Ours or a peer's.
    scenario : Scenario
        Map, robot, plant.
    plant : Plant, optional
        The scenario's if not given: `scenario_plant`.
    dt : float
        Period [s].
    settle : float
        How long the robot must stay within the tolerances to have arrived [s].
    stop_norm : float, optional
        If given, arrival is ``|x - goal| <= stop_norm`` over the whole state, as in the paper's
        study.
    info : dict, optional
        Kept with the run.
    watch : callable, optional
        Is called with each step: see `Watch`.
    lidar : Lidar, optional
        What the controller gets to see instead of the scenario's obstacles.
    """
    robot = scenario_plant(scenario) if plant is None else plant
    x = np.array(scenario.start)
    states, path, inputs, plans = [x], [x], [], []
    statuses, times = list[str](), list[float]()
    route = Route(scenario.goals, scenario.loop)
    steps = int(np.ceil(scenario.timeout * len(route.goals) / dt - 1e-9))
    clearance, outcome, inside, duration = np.inf, Outcome.TIMEOUT, 0.0, steps * dt
    moments = dt * np.arange(1, SUBSAMPLES + 1) / SUBSAMPLES
    step = _planning(controller, scenario, route, dt, path, watch, lidar)
    for k, plan, trace in periods(step, lambda x, u: robot.trace(x, u, dt, SUBSAMPLES), x, steps):
        inputs.append(plan.command)
        plans.append(plan.states)
        statuses.append(plan.status.name)
        times.append(plan.timing["total"])
        gaps = obstacle_gaps(scenario, trace, k * dt + moments)
        path.extend(trace)
        x = trace[-1]
        states.append(x)
        clearance = min(clearance, float(gaps.min(initial=np.inf)))
        if (gaps < 0.0).any():
            outcome = Outcome.COLLISION
            duration = k * dt + float(moments[np.argmax(gaps < 0.0)])
            break
        inside = inside + dt if _is_there(x, scenario, route.goal, stop_norm) else 0.0
        if inside and _is_held(route, plan, inside, settle):
            route.hold()
            inside = 0.0
        if route.done:
            outcome, duration = Outcome.REACHED, (k + 1) * dt
            break
    if outcome is Outcome.TIMEOUT and route.rounds:
        outcome = Outcome.REACHED
    ended = why_not(outcome, scenario, route, plan, x, duration)
    return Run(
        scenario,
        dt,
        outcome,
        duration,
        np.array(states),
        np.array(path),
        np.array(inputs),
        np.array(plans),
        tuple(statuses),
        np.array(times),
        clearance,
        {**_tuned(controller), **_legs(route), **ended, **(info or {})},
        scans=() if lidar is None else tuple(lidar.seen),
    )


def _planning(
    controller: Steps,
    scenario: Scenario,
    route: Route,
    dt: float,
    path: Sequence[Array],
    watch: Watch | None,
    lidar: Lidar | None,
) -> Callable[[Array, int], Plan]:
    """Give what plans in a period from what is measured and seen then; `path` grows meanwhile."""
    noise = np.random.default_rng([scenario.seed, 1])
    age = scenario.pose_age / dt

    def step(pose: Array, k: int) -> Plan:
        seen = _at(path, SUBSAMPLES * (k - age)) if age else pose
        measured = seen + noise.normal(size=3) * scenario.pose_noise
        obstacles = scenario.obstacles_at(k * dt) if lidar is None else [lidar.scan(seen, k * dt)]
        plan = controller.step(measured, np.array(route.goal), obstacles)
        if len(route.goals) > 1:
            plan = replace(plan, leg=route.leg)
        if watch is not None:
            watch(k * dt, measured, obstacles, plan)
        return plan

    return step


def _tuned(controller: Steps) -> dict[str, Any]:
    """Options of a controller of ours that are not the usual ones, to be kept with a run."""
    options = getattr(controller, "options", None)
    changed = options.changed() if isinstance(options, ControllerOptions) else {}
    return {"options": changed} if changed else {}


def _is_held(route: Route, plan: Plan, inside: float, settle: float) -> bool:
    """Whether the goal counts as held by a robot that has been there for so long [s]."""
    if route.is_last:
        return inside >= settle
    return plan.holding or inside >= max(settle, HELD)


def _legs(route: Route) -> dict[str, Any]:
    """Which goal of a route a drive came to; nothing for a single goal."""
    return {"route": route.report()} if len(route.goals) > 1 else {}


def _is_there(
    x: Array, scenario: Scenario, pose: tuple[float, ...], stop_norm: float | None
) -> bool:
    """Whether a robot at a state (3,) is at a goal: within the tolerances, or the norm if given."""
    goal = np.array(pose)
    if stop_norm is None:
        return bool(scenario.arrival.met(x, goal))
    error = x - goal
    error[2] = wrap(float(error[2]))
    return bool(np.linalg.norm(error) <= stop_norm)


def _at(path: Sequence[Array], place: float) -> Array:
    """Pose (3,) between two sub-samples; before the first the robot stood there."""
    whole, share = divmod(max(place, 0.0), 1.0)
    before, after = path[int(whole)], path[min(int(whole) + 1, len(path) - 1)]
    pose: Array = before + share * (after - before)
    return pose


STEPS = ("times", "poses", "plans", "margins", "commands", "clearances", "pose_ages", "step_times")
NUMBERS, WORDS = ("path_of", "circles_of"), ("statuses", "progress", "reasons")
"""Fields that have an entry for each step."""


@dataclass(frozen=True, eq=False)
class Details:
    """T steps, at the times at which they were really made.

    Times count from the moment in which the first command passed.
    """

    times: Array  # (T,) when each step was made, since the first command passed [s]
    poses: Array  # (T, 3) pose that each step planned from
    plans: Array  # (T, S, 3) states of the plans, `stage_time` apart
    stage_time: float  # time between the stages of a plan [s]
    margins: Array  # (T, S) margins that the plans keep at these stages [m]
    commands: Array  # (T, 2) commands that the plans begin with
    statuses: tuple[str, ...]
    progress: tuple[str, ...]
    reasons: tuple[str, ...]
    clearances: Array  # (T,) clearance of the plans [m]; infinite without obstacles
    pose_ages: Array  # (T,) age of each step's pose [s]; NaN if it is not known
    step_times: Array  # (T,) time that each step took [s]
    paths: tuple[Array, ...]  # paths (K, 2) that guidance followed [m]
    path_of: Array  # (T,) number of each step's path; -1: none
    circles: tuple[Array, ...]  # circles (M, 5) that were seen
    circles_of: Array  # (T,) number of those that each step saw; -1: none
    measured: Array  # (P, 4) poses as they came: time [s], x, y [m], theta [rad]
    sent: Array  # (C, 3) commands that went to the robot: time [s], v [m/s], omega [rad/s]
    gates: tuple[tuple[float, str, tuple[str, ...]], ...] = ()
    """Times [s], states of the safety gate, and the reasons for them."""
    health: tuple[tuple[float, Mapping[str, Any]], ...] = ()
    """Times [s], and the state of link and vehicle."""
    notes: tuple[tuple[float, str, bool], ...] = ()
    """Times [s], what was reported, and whether it is bad."""
    scans: tuple[tuple[float, LaserScan], ...] = ()  # times [s], and what was seen

    def between(self, begin: float, end: float) -> Details:
        """Give the steps from one time to another [s].

        Raises ScenarioError if there are none.
        """
        chosen = np.flatnonzero((self.times >= begin - 1e-6) & (self.times <= end + 1e-6))
        if not len(chosen):
            raise ScenarioError(
                f"no step from {begin:g} s to {end:g} s: "
                f"the drive lasts from {self.times[0]:.2f} s to {self.times[-1]:.2f} s"
            )
        arrays: dict[str, Any] = {name: getattr(self, name)[chosen] for name in (*STEPS, *NUMBERS)}
        words: dict[str, Any] = {
            name: tuple(getattr(self, name)[k] for k in chosen) for name in WORDS
        }
        gates = tuple(gate for gate in self.gates if gate[0] <= end)
        return replace(self, **arrays, **words, gates=gates)
