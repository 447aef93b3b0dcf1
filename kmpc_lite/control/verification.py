"""Whether the robot may drive what the solver found.

The model must agree with it, and the robot must be able to stop after it: `safe_stop` looks for the
stop trajectory (`stop_trajectory.py`). A plan without one is not driven, and the pipeline turns to
the last good plan's (`stop/backup.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.kernels.clearance import SPREAD_RATE
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.sqp_state import SQPResult
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.options import StepOptions, unit_length
from kmpc_lite.control.plan import PlannedAround
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.stop.stop_task import StopTask, StopTrajectory
from kmpc_lite.control.stop.stop_trajectory import StopTrajectories
from kmpc_lite.types import Array


class Verified(NamedTuple):
    """A solver's answer after its checks."""

    trajectory: Trajectory | None
    """What the next step is warm started from; None where the answer is of no use."""
    stop: StopTrajectory | None
    """What is driven next if no other plan is found; None: the plan must not be driven."""
    expected: Array
    """(3,) pose at the end of the coming period."""
    reason: str
    """What is wrong; empty where nothing is."""


class Verification:
    """Checks what the solver found.

    Parameters
    ----------
    problem : NavigationProblem
        Radius and period.
    options : StepOptions
        How much the model may contradict a plan.
    stops : StopTrajectories
        Finds stop trajectories.
    """

    def __init__(
        self, problem: NavigationProblem, options: StepOptions, stops: StopTrajectories
    ) -> None:
        unit = unit_length(problem)
        self._accepted_defect = options.accepted_defect * unit
        self._accepted_depth = options.accepted_depth * unit
        self._problem = problem
        self._stops, self._rates = stops, RateLimit(problem)

    def check(self, result: SQPResult, seen: Observation, task: StopTask) -> Verified:
        """Check whether a result may be driven; slow its first command where that makes it safe."""
        nothing = result.next_state
        if result.status is QPStatus.FAILED:
            return Verified(None, None, nothing, result.reason)
        if not np.isfinite(result.defect):
            return Verified(None, None, nothing, "the model's prediction is not finite")
        found, reason, expected = result.trajectory, result.reason, result.next_state
        if not result.defect <= self._accepted_defect:
            # the model contradicts the plan: its commands are good for what the model makes of them
            reason = f"rolled out anew: the model contradicted the plan by {result.defect:.3g}"
            found, periods = self._rolled_out(found, seen, task)
            # without margins nothing else would keep a shortened plan from an obstacle
            if not periods or (task.check is None and periods < len(found.inputs)):
                return Verified(found, None, expected, reason)
            if periods < len(found.inputs):
                reason += f", and shortened to {periods} periods"
            expected = found.states[1]
        checked = self._stops.find(found.states, found.inputs, task)
        if checked.slowed:
            found = Trajectory(checked.states, checked.inputs, found.duals)
            expected = found.states[1]
        if checked.stop is None:
            reason = "no way to a stop is clear"
        limited = self._within_reach(found, task)
        if limited is not found:
            found, expected = limited, limited.states[1]
        return Verified(found, checked.stop, expected, reason)

    def _rolled_out(
        self, plan: Trajectory, seen: Observation, task: StopTask
    ) -> tuple[Trajectory, int]:
        """What the model makes of a plan's commands, and for how many periods they may be driven.

        From the first stage that would cut into an obstacle on the robot is to stand.
        """
        inputs = plan.inputs
        states = task.model.rollout(plan.states[0], inputs, task.past)
        if not np.isfinite(states).all():
            return Trajectory(states, inputs, plan.duals), 0
        cut = np.flatnonzero(~(self._around(seen).clearances(states) >= -self._accepted_depth))
        periods = max(int(cut[0]) - 1, 0) if len(cut) else len(inputs)
        if 0 < periods < len(inputs):
            inputs = np.where(np.arange(len(inputs))[:, None] < periods, inputs, 0.0)
            states = task.model.rollout(plan.states[0], inputs, task.past)
        return Trajectory(states, inputs, plan.duals), periods

    def clearance(self, states: Array, seen: Observation) -> float:
        """Smallest distance between the edges of robot and obstacles along states (K, 3)."""
        return self._around(seen).clearance(states)

    def _around(self, seen: Observation) -> PlannedAround:
        hits = None if seen.view is None else seen.view.hits
        problem = self._problem
        return PlannedAround(
            seen.things[:, :SPREAD_RATE],
            seen.solids,
            problem.body_radius,
            problem.dt,
            hits=hits,
            footprint=problem.footprint,
        )

    def _within_reach(self, plan: Trajectory, task: StopTask) -> Trajectory:
        """Bring the command within reach of the one sent last, and roll the plan out anew."""
        if not self._rates.active:
            return plan
        command = self._rates.limit(plan.inputs[0], task.last)
        if command is plan.inputs[0] or np.array_equal(command, plan.inputs[0]):
            return plan
        inputs = plan.inputs.copy()
        inputs[0] = command
        states = task.model.rollout(plan.states[0], inputs, task.past)
        return Trajectory(states, inputs, plan.duals)
