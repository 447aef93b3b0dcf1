"""A controller whose solver, clock or poses fail by a schedule, and the counts of what follows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
import osqp
from numpy.typing import ArrayLike

from kmpc_lab.studies.training import DT
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.nmpc.osqp_workspace import SOLVED, OSQPWorkspace, osqp_settings
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.options import OSQPOptions, StopOptions
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

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


@dataclass
class Switch:
    """Which fault solves have, and the chance in it.

    While `fault` names a status, solves end with it; ``update refused`` refuses data.
    """

    random: np.random.Generator
    fault: str = ""


class BrokenWorkspace(OSQPWorkspace):
    """OSQP as controllers use it, on a compiled half with a switch."""

    def __init__(self, switch: Switch, qp: NavigationQP, options: OSQPOptions) -> None:
        self._made_of = switch, qp, options
        super().__init__(qp.P, qp.q, qp.A, qp.lower, qp.upper, **osqp_settings(options))

    def _set_up(self) -> None:
        super()._set_up()
        if not isinstance(self._solver, BrokenSolver):
            self._solver = BrokenSolver(self._solver, self._made_of[0])

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self), self._made_of


class BrokenSolver:
    """OSQP's compiled half with a switch."""

    def __init__(self, solver: Any, switch: Switch) -> None:
        self._solver, self._switch = solver, switch

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def update_data_vec(self, **data: Any) -> int:
        """Take new vectors, or refuse them as OSQP refuses bounds that cross.

        It then returns an error code, and everything stays as it was.
        """
        refused = self._switch.fault == "update refused"
        return 1 if refused else int(self._solver.update_data_vec(**data))

    @property
    def info(self) -> Any:
        """OSQP's account of the last solve."""
        info, fault = self._solver.info, self._switch.fault
        return _Told(info, int(STATUSES[fault]), fault) if fault in STATUSES else info

    @property
    def solution(self) -> Any:
        """OSQP's solution, moved away from the optimum where the solve was cut short.

        After a failed solve it is what OSQP leaves there.
        """
        found, fault = self._solver.solution, self._switch.fault
        if fault not in STATUSES or int(STATUSES[fault]) == SOLVED:
            return found
        if fault in ("solved inaccurate", "max iter", "time limit"):
            off = CUT_SHORT * self._switch.random.normal(size=len(found.x))
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
"""A plan must be found again within this time after the inputs are sane again [s]."""
BLIND = 3.0
"""After this time without a usable pose the command must be zero [s]."""
BUDGET = 0.05
"""Time budget of the drives whose clock jumps [s]; the clock jumps by more than that at each look.
"""


@dataclass
class FaultCounts:
    """What was seen in the drives of one kind of failure."""

    kind: str
    slip: float
    drives: int = 0
    steps: int = 0
    failed_steps: int = 0
    """Steps in which the failure was forced."""
    fallback: int = 0
    stopped: int = 0
    collisions: int = 0
    collisions_failing: int = 0
    """Those of them in a period whose step was made to fail."""
    late_stops: int = 0
    """Steps in which the robot still had to drive, though its stop trajectory had ended."""
    late_recoveries: int = 0
    """Seconds of sane inputs after a failure in which no plan was found."""
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
    counts : FaultCounts
        Added to.
    """

    def __init__(
        self, model: KoopmanModel, scenario: Scenario, kind: str, counts: FaultCounts
    ) -> None:
        self.kind, self.counts = kind, counts
        self._random = np.random.default_rng([scenario.seed, KINDS.index(kind)])
        self._time, self._jump = 0.0, 0.0
        timed: dict[str, Any] = (
            {"time_budget": BUDGET, "clock": self._clock} if kind == "clock jumps" else {}
        )
        problem, options = scenario.problem(), scenario.options
        self._switch = Switch(self._random)
        solver = partial(BrokenWorkspace, self._switch)
        self.controller = Controller(model, problem, options=options, solver=solver, **timed)
        self._rates = RateLimit(self.controller.problem)
        self._step, self._begin, self._end = 0, 0, 0
        self._frozen = np.zeros(3)
        self._stop_left, self._sane, self._blind, self._planned = 0, 0, 0, False
        self.failing = False
        """Whether the last step was made to fail."""
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
        self._switch.fault = self.kind if failing else ""
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
        last = self.controller.state.trajectory
        if last is not None and self.kind.startswith("warm start"):
            bad = np.nan if self.kind.endswith("NaN") else 1e9
            # the next stage stays as it is, or the start would be dropped at once
            states, inputs, duals = last.states.copy(), last.inputs.copy(), last.duals.copy()
            states[2:], inputs[1:], duals[:] = bad, bad, bad
            self.controller.state.trajectory = Trajectory(states, inputs, duals)
        return pose

    def _count(self, plan: Plan, failing: bool, seen: bool) -> None:
        counts = self.counts
        counts.steps += 1
        counts.failed_steps += failing
        counts.fallback += plan.status is PlanStatus.FALLBACK
        counts.stopped += plan.status is PlanStatus.STOPPED
        if plan.status in (PlanStatus.FALLBACK, PlanStatus.STOPPED):
            counts.late_stops += bool(self._stop_left <= 0 and plan.command.any())
            self._stop_left -= 1
        else:
            # the longest stop trajectory that this command can have; its last command is zero
            self._stop_left = len(self._rates.ramp(plan.command)) - 1
            if self.controller.model.history:
                self._stop_left += round(StopOptions().further_time / DT)
        self.failing = failing
        self._sane = 0 if failing else self._sane + 1
        self._planned = not failing and (
            self._planned or plan.status not in (PlanStatus.FALLBACK, PlanStatus.STOPPED)
        )
        counts.late_recoveries += self._sane == round(RECOVERY / DT) and not self._planned
        self._blind = 0 if seen else self._blind + 1
        counts.blind_steps += bool(self._blind > BLIND / DT and plan.command.any())
