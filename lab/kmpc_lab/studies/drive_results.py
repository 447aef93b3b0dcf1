"""One drive in closed loop, judged by the true poses, and tables of many: what studies share.

In pose means within `in_pose` by the true pose, held for a second. A collision is an overlap of
outlines at any of ten looks a period; the account of it shares no code with the controller.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from kmpc_lab.sim.periods import periods
from kmpc_lite.control import Circle, Controller, NavigationProblem
from kmpc_lite.control.plan import Plan
from kmpc_lite.scenario.arrival import in_pose
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.types import Array

HELD = 1.0
"""How long the robot must hold its goal [s]."""
SHARES = "stopped", "fallback", "feasible"
CREEPS = 0.02
"""Share of its speed below which a robot has no gear."""


@dataclass(frozen=True)
class DriveResult:
    """What became of one drive."""

    axes: tuple[str, ...]
    """Which row of its study's table it belongs to."""
    seed: int
    arrived: bool
    """In pose, and held there."""
    held_elsewhere: bool
    collided: bool
    seconds: float
    """Until it was in pose, and stayed there; of one that never was, all but a second."""
    ideal_seconds: float
    clearance: float
    """Least one [m]."""
    fastest: float
    """Speed that it was commanded [m/s]."""
    gear_changes: int
    stopped: float
    """Share of the steps STOPPED, ..."""
    fallback: float
    feasible: float
    jerk: float
    """RMS of the change of commands from step to step, as a share of the bounds."""
    ended: str
    """Progress that was reported at the end, and its reason."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "axes", tuple(self.axes))  # a record has a list


@dataclass(frozen=True)
class Drive:
    """From where to where, among what, for how long."""

    start: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    ideal: float
    """Least time, obstacles aside [s]."""
    limit: float
    """Longest time [s]."""
    obstacles: Callable[[Array], Any]
    """What the controller is given at a true pose (3,)."""
    gaps: Callable[[Array], Array]
    """Distances (n,) of the robot at poses (n, 3) from the nearest obstacle [m]."""
    spread: Array = field(default_factory=lambda: np.zeros(3))
    """Standard deviations of a measured pose, (3,) [m, m, rad]."""


def closed_loop(
    axes: tuple[str, ...],
    seed: int,
    controller: Controller,
    move: Callable[[Array, Array], Array],
    task: Drive,
) -> DriveResult:
    """Drive, and judge by the true poses; `move` gives poses (n, 3) of a period."""
    problem, dt = controller.problem, controller.problem.dt
    random, tolerance = np.random.default_rng([seed, 7]), in_pose(problem.body_radius, task.spread)
    full = np.maximum(np.abs(problem.u_min), np.abs(problem.u_max))
    inside, clearance, commands, statuses = 0.0, math.inf, [], []

    def step(pose: Array, k: int) -> Plan:
        measured = pose + task.spread * random.normal(size=3)
        return controller.step(measured, task.goal, task.obstacles(pose))

    for period in periods(step, move, task.start, math.ceil(task.limit / dt)):
        plan, poses = period.plan, period.poses
        commands.append(plan.command / full)
        statuses.append(plan.status.name)
        clearance = min(clearance, float(task.gaps(poses).min(initial=math.inf)))
        inside = inside + dt if tolerance.met(poses[-1], task.goal) else 0.0
        if clearance < 0.0 or inside >= HELD:
            break
    driven, count = np.array(commands), len(commands)
    gears = np.sign(driven[np.abs(driven[:, 0]) > CREEPS, 0])
    shares = {name: statuses.count(name.upper()) / count for name in SHARES}
    return DriveResult(
        axes,
        seed,
        arrived=inside >= HELD,
        held_elsewhere=plan.holding and inside < HELD,
        collided=clearance < 0.0,
        seconds=count * dt - HELD,
        ideal_seconds=task.ideal,
        clearance=clearance,
        fastest=float(np.abs(driven[:, 0]).max()) * float(full[0]),
        gear_changes=int((gears[1:] != gears[:-1]).sum()),
        jerk=jerk(np.diff(driven, axis=0)),
        ended=f"{plan.progress.value}: {plan.reason}" if plan.reason else plan.progress.value,
        **shares,
    )


def jerk(changes: Array) -> float:
    """RMS of the changes (T, m) of commands from step to step, as shares of the bounds."""
    return float(np.sqrt((changes**2).sum(axis=1).mean())) if len(changes) else 0.0


def circle_gaps(problem: NavigationProblem, circles: Sequence[Circle]) -> Callable[[Array], Array]:
    """Distances of a robot, or of its outline, from circles at rest."""
    rows = np.array(circles, dtype=float).reshape(1, -1, 5)

    def gaps(poses: Array) -> Array:
        if problem.footprint is not None:
            return footprint_gaps(problem.footprint, poses, rows.repeat(len(poses), axis=0), ())
        away = np.hypot(*np.moveaxis(poses[:, None, :2] - rows[..., :2], -1, 0)) - rows[..., 2]
        out: Array = away.min(axis=1, initial=np.inf) - problem.robot_radius
        return out

    return gaps


class Column(NamedTuple):
    """A column of a table."""

    title: str
    format: str
    """Of its numbers: ``.2f``."""
    of: Callable[[Sequence[Any]], float]
    """Its number for the drives of a row."""


def count_of(name: str) -> Callable[[Sequence[Any]], float]:
    """How many drives have something."""
    return lambda rows: sum(getattr(row, name) for row in rows)


def mean_of(name: str) -> Callable[[Sequence[Any]], float]:
    """What drives have in the mean."""
    return lambda rows: float(np.mean([getattr(row, name) for row in rows]))


def time_to_ideal(rows: Sequence[DriveResult]) -> float:
    """Median of the times of those in pose, as multiples of ideal ones."""
    times = [row.seconds / row.ideal_seconds for row in rows if row.arrived]
    return float(np.median(times)) if times else math.nan


DRIVES = (
    Column("drives", "d", len),
    Column("in pose", "d", count_of("arrived")),
    Column("collisions", "d", count_of("collided")),
)
TIME = Column("time to ideal", ".2f", time_to_ideal)
STOPPED = Column("stopped", ".1%", mean_of("stopped"))


def table(
    rows: Sequence[Any],
    columns: Sequence[Column],
    course: str,
    total: str = "",
    listed: Sequence[Any] | None = None,
) -> str:
    """Table with a line for each of the `axes`, then every drive that touched or did not arrive.

    Parameters
    ----------
    rows, columns : sequence
        Drives (`DriveResult`, or what has its axes, seed, arrived, collided, ended), and what is
        told of those of a line.
    course : str
        What a seed draws: ``map``.
    total : str
        Name of a line of all; none if not given.
    listed : sequence, optional
        Drives of which those are told that did not arrive; all if not given.
    """
    lines = {axes: [row for row in rows if row.axes == axes] for axes in (r.axes for r in rows)}
    if total:
        lines[(total, *[""] * (len(rows[0].axes) - 1))] = list(rows)
    widths = [max(map(len, words)) for words in zip(*lines, strict=True)]
    told = [[f"{column.of(some):{column.format}}" for column in columns] for some in lines.values()]
    sizes = [
        max(len(column.title), *map(len, numbers))
        for column, numbers in zip(columns, zip(*told, strict=True), strict=True)
    ]

    def line(words: Sequence[str], numbers: Sequence[str]) -> str:
        named = (f"{word:{width}}" for word, width in zip(words, widths, strict=True))
        return "  ".join([*named, *(f"{n:>{s}}" for n, s in zip(numbers, sizes, strict=True))])

    listed = rows if listed is None else listed
    bad = [row for row in listed if row.collided or not row.arrived]
    return "\n".join(
        [
            line([""] * len(widths), [column.title for column in columns]),
            *map(line, lines, told),
            *(
                f"{', '.join(row.axes)}, {course} {row.seed}: "
                f"{'touched' if row.collided else row.ended or 'out of time'}"
                for row in bad
            ),
        ]
    )
