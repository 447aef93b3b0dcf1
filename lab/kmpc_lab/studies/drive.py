"""One drive in closed loop, judged by the true poses: the loop and the account of every study.

In pose means within a tolerance by the true pose, held for a time. A touch is an overlap of
outlines at any look, ten a period; the account of it shares no code with the controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from kmpc_lab.report.picture import Trace
from kmpc_lab.sim.closed_loop import periods
from kmpc_lite.control import Circle, Controller, Footprint, NavigationProblem, Polygon, Wall
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.scenario.touch import footprint_gaps, in_pose
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

HELD = 1.0  # how long the robot must hold its goal [s]
SHARES = "stopped", "fallback", "feasible"
CREEPS = 0.02  # share of its speed below which a robot has no gear


@dataclass(frozen=True)
class DriveResult:
    """What became of one drive."""

    arrived: bool  # in pose, and held there
    collided: bool
    seconds: float
    """Until it was in pose, and stayed there; of one that never was, all but the time to hold."""
    ideal_seconds: float  # least time, as its study reckons it [s]
    clearance: float  # least one [m]
    fastest: float  # speed that it was commanded [m/s]
    gear_changes: int
    jerk: float  # RMS of the change of commands from step to step, as a share of the bounds
    stopped: float  # share of the steps STOPPED, ...
    fallback: float
    feasible: float
    step_p50: float  # time of a step [ms], median, and ...
    step_p99: float
    ended: str  # progress that was reported at the end, and its reason
    held_elsewhere: bool = False
    peer: bool = False  # whether it was driven by something that ours is compared with
    more: Mapping[str, float] = field(default_factory=dict)  # what only its study tells
    axes: tuple[str, ...] = ()  # which row of its study's table it belongs to
    seed: int = 0
    trace: Trace | None = field(default=None, compare=False, repr=False)
    """Of a drive that was not read from a record."""

    def as_record(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        values = {k: v for k, v in self.__dict__.items() if k != "trace"}
        return {**values, "axes": list(self.axes), "more": dict(self.more)}

    @classmethod
    def of_record(cls, values: Mapping[str, Any]) -> DriveResult:
        """Give what `as_record` told; TypeError or KeyError for anything else."""
        return cls(**{**values, "axes": tuple(values["axes"]), "more": dict(values["more"])})


@dataclass(frozen=True)
class Task:
    """From where, until when, among what."""

    start: Array  # (3,)
    goal: Array  # (3,)
    there: Callable[[Array], bool]  # whether a true pose (3,) is in pose
    gaps: Callable[[Array], Array]
    """Distances (n,) of the robot at poses (n, 3) of a period from the nearest obstacle [m]."""
    ideal: float  # least time, as the study reckons it [s]
    limit: float  # longest time [s]
    full: Array  # largest commands (m,)
    dt: float  # period [s]
    held: float = HELD  # how long it must be in pose [s]
    body: Footprint | float = 0.15  # as `Trace` has it, and ...
    around: Sequence[Circle | Polygon | Wall | World] = ()


def closed_loop(
    step: Callable[[Array, int], Plan], move: Callable[[Array, Array], Array], task: Task
) -> DriveResult:
    """Drive until the robot has held its goal, has touched something, or is out of time.

    `step`, `move`: as `periods` has them. `task`: what is driven.
    """
    dt, full = task.dt, task.full
    inside, count, clearance, poses = 0.0, 0, math.inf, [task.start]
    commands, statuses, times = list[Array](), list[str](), list[float]()
    for period in periods(step, move, task.start, math.ceil(task.limit / dt)):
        plan, moved = period.plan, period.poses
        commands.append(plan.command)
        statuses.append(plan.status.name)
        times.append(plan.timing["total"])
        poses.append(moved[-1])
        clearance = min(clearance, float(task.gaps(moved).min(initial=math.inf)))
        is_there = task.there(moved[-1])
        inside, count = (inside + dt if is_there else 0.0), count + 1
        if clearance < 0.0 or (is_there and inside >= task.held):
            break
    driven = np.array(commands) / full
    arrived = is_there and inside >= task.held and clearance >= 0.0
    return DriveResult(
        arrived,
        clearance < 0.0,
        seconds=count * dt - task.held,
        ideal_seconds=task.ideal,
        clearance=clearance,
        fastest=float(np.abs(driven[:, 0]).max()) * float(full[0]),
        ended=f"{plan.progress.value}: {plan.reason}" if plan.reason else plan.progress.value,
        held_elsewhere=plan.holding and not arrived,
        trace=Trace(
            np.array(poses),
            np.array(commands),
            tuple(statuses),
            task.goal,
            task.body,
            task.around,
            dt,
        ),
        **counted(driven, statuses, times),
    )


def counted(driven: Array, statuses: Sequence[str], times: Sequence[float] | Array) -> Any:
    """What a `DriveResult` tells of commands (T, m) [bounds], statuses and times of steps [s]."""
    gears = np.sign(driven[np.abs(driven[:, 0]) > CREEPS, 0])
    p50, p99 = 1e3 * np.quantile(times, (0.5, 0.99))
    shares = {name: statuses.count(name.upper()) / len(driven) for name in SHARES}
    changes = int((gears[1:] != gears[:-1]).sum())
    steady = jerk(np.diff(driven, axis=0))
    return {**shares, "gear_changes": changes, "jerk": steady, "step_p50": p50, "step_p99": p99}


def drive_past(
    controller: Controller,
    move: Callable[[Array, Array], Array],
    ends: tuple[Array, Array],
    around: Sequence[Circle | Polygon | Wall],
    times: tuple[float, float],
    obstacles: Callable[[Array], Any] | None = None,
    spread: Array | None = None,
    seed: int = 0,
) -> DriveResult:
    """Drive a controller of ours from a start to a goal (3,), (3,).

    `around`: what stands there. `times`: least and longest time [s]. `obstacles`: what the
    controller is given at a true pose (3,), if not all that stands there. `spread`: standard
    deviations of a measured pose, (3,) [m, m, rad]. `seed`: of what is measured.
    """
    problem, (start, goal) = controller.problem, ends
    sigma = np.zeros(3) if spread is None else spread
    random, tolerance = np.random.default_rng([seed, 7]), in_pose(problem.body_radius, sigma)

    def step(pose: Array, k: int) -> Plan:
        seen = around if obstacles is None else obstacles(pose)
        return controller.step(pose + sigma * random.normal(size=3), goal, seen)

    task = Task(
        start,
        goal,
        lambda pose: bool(tolerance.met(pose, goal)),
        gaps_of(problem, around),
        *times,
        full=np.maximum(np.abs(problem.u_min), np.abs(problem.u_max)),
        dt=problem.dt,
        body=problem.footprint or problem.robot_radius,
        around=around,
    )
    return closed_loop(step, move, task)


def commanded(command: Array) -> Plan:
    """Give a peer's command (m,) as a plan."""
    nothing = np.empty((0, len(command)))
    return Plan(command, np.empty((0, 3)), nothing, PlanStatus.SOLVED, 0, {"total": math.nan})


def jerk(changes: Array) -> float:
    """RMS of the changes (T, m) of commands from step to step, as shares of the bounds."""
    return float(np.sqrt((changes**2).sum(axis=1).mean())) if len(changes) else 0.0


def gaps_of(
    problem: NavigationProblem, around: Sequence[Circle | Polygon | Wall]
) -> Callable[[Array], Array]:
    """Distances (n,) of a robot at poses (n, 3), by its outline, from what stands there.

    A round robot is measured from circles and polygons.
    """
    rows = np.array([c for c in around if isinstance(c, Circle)], dtype=float).reshape(1, -1, 5)
    solids = [thing for thing in around if not isinstance(thing, Circle)]
    if (outline := problem.footprint) is not None:
        return lambda poses: footprint_gaps(outline, poses, rows.repeat(len(poses), 0), solids)
    corners = [np.array(solid.vertices) for solid in solids if isinstance(solid, Polygon)]
    edges = [np.hstack([some, np.roll(some, -1, axis=0)]) for some in corners]
    world, radius = World(rows[0], np.concatenate([np.empty((0, 4)), *edges])), problem.robot_radius
    return lambda poses: world.clearance(poses[:, :2], np.zeros(len(poses))) - radius
