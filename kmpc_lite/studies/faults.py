"""``kmpc study faults``: closed loops with forced failures.

The solver, the clock, the warm start or the pose fails again and again.

Each drive has one kind of failure, in bursts of random length between stretches of sane steps.
Counted are collisions (at four sub-samples), whether the commands came to a stop within the tail
that was verified before, whether a plan was had within a second of sane inputs, and whether the
command was zero after three seconds without a usable pose.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import osqp
from numpy.typing import ArrayLike

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.nmpc.osqp_workspace import SOLVED, OSQPWorkspace
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.control.safe_stop.braking import Braking
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.sim.closed_loop import Outcome, drive
from kmpc_lite.sim.maps.families import random_map
from kmpc_lite.sim.scenario.files import Scenario
from kmpc_lite.studies.table1 import DT, REPORTING_SEED, TRAINING, train
from kmpc_lite.types import Array

SLIPS = (0.05, 0.2)
FAMILIES = ("dense", "narrow", "moving")
FIXED = tuple(f"four_circles_{i}" for i in range(1, 5))
STATUSES = {
    "solved inaccurate": osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
    "primal infeasible": osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE,
    "primal infeasible inaccurate": osqp.SolverStatus.OSQP_PRIMAL_INFEASIBLE_INACCURATE,
    "dual infeasible": osqp.SolverStatus.OSQP_DUAL_INFEASIBLE,
    "dual infeasible inaccurate": osqp.SolverStatus.OSQP_DUAL_INFEASIBLE_INACCURATE,
    "max iter": osqp.SolverStatus.OSQP_MAX_ITER_REACHED,
    "time limit": osqp.SolverStatus.OSQP_TIME_LIMIT_REACHED,
    "non-convex": osqp.SolverStatus.OSQP_NON_CVX,
    "unsolved": osqp.SolverStatus.OSQP_UNSOLVED,
}
GARBAGE = 2.14e9
"""What OSQP leaves in the solution of a problem that it could not solve."""
CUT_SHORT = 1e-3
"""How far an iterate that was stopped early is from the solution, as a share of its values and as a
number."""
OTHERS = (
    "update refused",
    "clock jumps",
    "warm start NaN",
    "warm start huge",
    "pose NaN",
    "pose frozen",
    "pose lost for long",
)
KINDS = (*STATUSES, *OTHERS)
RECOVERY = 1.0
"""Within which a plan must be had again once the inputs are sane [s]."""
BLIND = 3.0
"""After which without a usable pose the command must be zero [s]."""
BUDGET = 0.05
"""Time budget of the drives whose clock jumps [s], by more than that at each look."""


class BrokenSolver:
    """OSQP's compiled half with a switch.

    While `fault` names a status, solves end with it; ``update refused`` refuses data.
    """

    def __init__(self, solver: Any, random: np.random.Generator) -> None:
        self._solver, self._random = solver, random
        self.fault = ""

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def update_data_vec(self, **data: Any) -> int:
        """Take new vectors, or refuse them as OSQP refuses bounds that cross.

        It then returns an error code, and everything stays as it was.
        """
        return 1 if self.fault == "update refused" else int(self._solver.update_data_vec(**data))

    @property
    def info(self) -> Any:
        """OSQP's account of the last solve."""
        return (
            _Told(self._solver.info, int(STATUSES[self.fault]), self.fault)
            if self.fault in STATUSES
            else self._solver.info
        )

    @property
    def solution(self) -> Any:
        """OSQP's solution, moved away from the optimum where the solve was cut short.

        After a failed solve it is what OSQP leaves there.
        """
        found = self._solver.solution
        if self.fault not in STATUSES or int(STATUSES[self.fault]) == SOLVED:
            return found
        if self.fault in ("solved inaccurate", "max iter", "time limit"):
            off = CUT_SHORT * self._random.normal(size=len(found.x))
            return _Solution(np.array(found.x) * (1.0 + off) + off, np.array(found.y))
        return _Solution(np.full(len(found.x), GARBAGE), np.full(len(found.y), GARBAGE))


@dataclass
class _Solution:
    x: Array
    y: Array


class _Told:
    """OSQP's info with another status."""

    def __init__(self, info: Any, status_val: int, status: str) -> None:
        self._info, self.status_val, self.status = info, status_val, f"{status} (injected)"

    def __getattr__(self, name: str) -> Any:
        return getattr(self._info, name)


@dataclass
class Counts:
    """What was seen in the drives of one kind of failure."""

    kind: str
    slip: float
    drives: int = 0
    steps: int = 0
    failed_steps: int = 0
    """With the failure injected."""
    fallback: int = 0
    stopped: int = 0
    collisions: int = 0
    late_stops: int = 0
    """Steps on which the robot was still told to drive, though its tail had ended."""
    late_recoveries: int = 0
    """Seconds of sane inputs after a failure in which no plan was had."""
    blind_steps: int = 0
    """Steps with a command other than zero after three seconds without a usable pose."""
    arrived: int = 0

    @property
    def bad(self) -> bool:
        """Whether anything was seen that must not be."""
        return bool(self.collisions or self.late_stops or self.late_recoveries or self.blind_steps)


class FaultyLoop:
    """A controller whose surroundings fail by a schedule; it counts what comes of it.

    Parameters
    ----------
    model : KoopmanModel
        Of the controller.
    scenario : Scenario
        Map, and the seed of the schedule.
    kind : str
        One of `KINDS`.
    counts : Counts
        Added to.
    """

    def __init__(self, model: KoopmanModel, scenario: Scenario, kind: str, counts: Counts) -> None:
        self.kind, self.counts = kind, counts
        self._random = np.random.default_rng([scenario.seed, KINDS.index(kind)])
        self._time, self._jump = 0.0, 0.0
        options: dict[str, Any] = (
            {"time_budget": BUDGET, "clock": self._clock} if kind == "clock jumps" else {}
        )
        self.controller = Controller(model, scenario.problem(), **options)
        workspace = self.controller._sqp.workspace
        assert isinstance(workspace, OSQPWorkspace)
        self._solver = workspace._solver = BrokenSolver(workspace._solver, self._random)
        self._braking = Braking(self.controller.problem, StopOptions())
        self._step, self._begin, self._end = 0, 0, 0
        self._frozen = np.zeros(3)
        self._tail_left, self._sane, self._blind, self._planned = 0, 0, 0, False
        self._next_burst()

    def _clock(self) -> float:
        self._time += self._jump
        return self._time

    def _next_burst(self) -> None:
        """Draw when the next failure begins and how many steps it lasts: short and long ones."""
        self._begin = self._step + int(self._random.integers(4, 20))
        longest = {"pose lost for long": (20, 60), "pose frozen": (1, 6)}.get(self.kind, (1, 16))
        self._end = self._begin + int(self._random.integers(*longest))

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: Any = ()) -> Plan:
        """Plan from a pose, with a failure or without."""
        pose = np.array(x, dtype=float)
        if self._step >= self._end:
            self._next_burst()
        failing = self._begin <= self._step
        if not failing:
            self._frozen = pose.copy()
        seen = self._break(pose) if failing else pose
        self._solver.fault = self.kind if failing else ""
        self._jump = 2.0 * BUDGET if failing and self.kind == "clock jumps" else 0.0
        plan = self.controller.step(seen, goal, obstacles)
        self._count(plan, failing, bool(np.isfinite(seen).all()))
        self._step += 1
        return plan

    def _break(self, pose: Array) -> Array:
        """Poison the warm start, or give the pose as a broken sensor does."""
        if self.kind in ("pose NaN", "pose lost for long"):
            return np.full(3, np.nan)
        if self.kind == "pose frozen":
            return self._frozen.copy()
        last = self.controller._last
        if last is not None and self.kind.startswith("warm start"):
            bad = np.nan if self.kind.endswith("NaN") else 1e9
            # the next stage stays as it is, or the start would be dropped at once
            states, inputs, duals = last.states.copy(), last.inputs.copy(), last.duals.copy()
            states[2:], inputs[1:], duals[:] = bad, bad, bad
            self.controller._last = Trajectory(states, inputs, duals)
        return pose

    def _count(self, plan: Plan, failing: bool, seen: bool) -> None:
        counts = self.counts
        counts.steps += 1
        counts.failed_steps += failing
        counts.fallback += plan.status is PlanStatus.FALLBACK
        counts.stopped += plan.status is PlanStatus.STOPPED
        if plan.status in (PlanStatus.FALLBACK, PlanStatus.STOPPED):
            counts.late_stops += bool(self._tail_left <= 0 and plan.command.any())
            self._tail_left -= 1
        else:
            # the longest that a tail of this command can be; its last command is zero
            self._tail_left = len(self._braking.ramp(plan.command)) - 1
            if self.controller.model.history:
                self._tail_left += round(StopOptions().further_time / DT)
        self._sane = 0 if failing else self._sane + 1
        self._planned = not failing and (
            self._planned or plan.status not in (PlanStatus.FALLBACK, PlanStatus.STOPPED)
        )
        counts.late_recoveries += self._sane == round(RECOVERY / DT) and not self._planned
        self._blind = 0 if seen else self._blind + 1
        counts.blind_steps += bool(self._blind > BLIND / DT and plan.command.any())


def drive_faults(
    kind: str, slip: float, model: KoopmanModel, scenarios: Sequence[Scenario]
) -> Counts:
    """Drive scenarios with one kind of failure; this is what a worker does."""
    counts = Counts(kind, slip)
    for scenario in scenarios:
        run = drive(FaultyLoop(model, scenario, kind, counts), scenario, dt=DT)
        counts.drives += 1
        counts.collisions += run.outcome is Outcome.COLLISION
        counts.arrived += run.outcome is Outcome.REACHED
    return counts


def faults_study(
    executor: Executor,
    maps: int = 5,
    slips: Sequence[float] = SLIPS,
    kinds: Sequence[str] = KINDS,
    families: Sequence[str] = FAMILIES,
    first_seed: int = REPORTING_SEED,
    training: Mapping[str, int] = TRAINING,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Counts]:
    """Drive every kind of failure over the maps of four circles and random ones, at every slip.

    Parameters
    ----------
    executor : Executor
        Does the work.
    maps : int
        Random maps of each family.
    slips, kinds, families : sequence
        Of the plant; of `KINDS`; of `maps.FAMILIES`.
    first_seed : int
        The first map's.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    progress : callable
        Called with cells done and cells in all.

    Returns
    -------
    list of Counts
        One for each kind and slip.
    """
    lessons = {slip: executor.submit(train, slip, "integral", **training) for slip in slips}
    jobs = []
    for slip in slips:
        scenarios = [
            replace(Scenario.load(name), slip=slip, seed=first_seed + i)
            for i, name in enumerate(FIXED)
        ]
        scenarios += [
            random_map(family, first_seed + i, slip) for family in families for i in range(maps)
        ]
        jobs += [
            executor.submit(drive_faults, kind, slip, lessons[slip].result(), scenarios)
            for kind in kinds
        ]
    rows = []
    for job in jobs:
        rows.append(job.result())
        progress(len(rows), len(jobs))
    return rows


def format_faults(rows: Sequence[Counts]) -> str:
    """Table of the counts, and their sums."""
    columns = {
        "drives": "drives",
        "steps": "steps",
        "failing": "failed_steps",
        "fallback": "fallback",
        "stopped": "stopped",
        "collisions": "collisions",
        "late stop": "late_stops",
        "late plan": "late_recoveries",
        "blind": "blind_steps",
        "arrived": "arrived",
    }
    lines = [f"{'failure':30}{'slip':>6}" + "".join(f"{h:>11}" for h in columns)]
    for row in rows:
        lines.append(
            f"{row.kind:30}{row.slip:6g}"
            + "".join(f"{getattr(row, c):11d}" for c in columns.values())
        )
    total = {c: sum(getattr(row, c) for row in rows) for c in columns.values()}
    lines.append(f"{'all':36}" + "".join(f"{total[c]:11d}" for c in columns.values()))
    lines.append(
        "late stop: steps still driven after the tail's end; late plan: "
        "none within 1 s of sane inputs; "
        "blind: commands other than zero after 3 s without a pose"
    )
    return "\n".join(lines)


def as_dicts(rows: Sequence[Counts]) -> list[dict[str, Any]]:
    """Plain values, for JSON."""
    return [asdict(row) for row in rows]
