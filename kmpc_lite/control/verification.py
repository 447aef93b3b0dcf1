"""Whether the robot may drive what the solver found, and what it does if not.

What the model contradicts is rolled out anew. Then `SafeMotions` looks for the largest share of the
plan from which the robot comes to rest clear. Without one the plan is not driven: `Fallback`
follows the last safe motion, or brakes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.kernels.clearance import SPREAD_RATE
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.sqp import SQPResult
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import StepOptions, unit_length
from kmpc_lite.control.plan import GoalProgress, Plan, PlannedAround, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.safe_motion import SafeMotions
from kmpc_lite.control.task import Task
from kmpc_lite.types import Array

ACCEPTED_DEPTH = 2 / 15
"""How deep a plan that was rolled out may cut into an obstacle and still be driven, without margins
[radii]: the next pass mends it."""


class Verified(NamedTuple):
    """A solver's answer after its checks."""

    trajectory: Trajectory | None
    """What the next step is warm started from; None if the answer is of no use."""
    motion: Array | None
    """(T, 2) from the coming command to rest; None: the plan must not be driven."""
    reason: str
    """What is wrong; empty if nothing is."""


class Verification:
    """Checks what the solver found."""

    def __init__(
        self, problem: NavigationProblem, options: StepOptions, motions: SafeMotions
    ) -> None:
        unit = unit_length(problem)
        self.accepted_defect = options.accepted_defect * unit
        self.accepted_depth = ACCEPTED_DEPTH * unit
        self._problem, self._motions, self._rates = problem, motions, RateLimit(problem)

    def check(self, result: SQPResult, now: Now, task: Task) -> Verified:
        """Check whether a result may be driven; slow its first command where that makes it safe."""
        if result.status is QPStatus.FAILED:
            return Verified(None, None, result.reason)
        if not np.isfinite(result.defect):
            return Verified(None, None, "the model's prediction is not finite")
        found, reason = result.trajectory, result.reason
        states, inputs = found.states, found.inputs
        contradicted = not result.defect <= self.accepted_defect
        if contradicted:
            reason = f"rolled out anew: the model contradicted the plan by {result.defect:.3g}"
        command = self._rates.limit(inputs[0], task.last)
        beyond = not np.array_equal(command, inputs[0])
        if contradicted or beyond:
            inputs = inputs.copy()
            inputs[0] = command
            states = task.model.rollout(states[0], inputs, task.past)
            if not np.isfinite(states).all():
                return Verified(Trajectory(states, inputs, found.duals), None, reason)
        if contradicted and task.margins is None:
            # without margins nothing else would keep such a plan from an obstacle
            if not self.clearance(states, now) >= -self.accepted_depth:
                return Verified(found, None, reason)
        motion = self._motions.find(states, inputs, task)
        if motion.commands is None:
            reason = "no way to a stop is clear"
        if motion.inputs is not found.inputs:
            found = Trajectory(motion.states, motion.inputs, found.duals)
        return Verified(found, motion.commands, reason)

    def clearance(self, states: Array, now: Now) -> float:
        """Smallest distance between the edges of robot and obstacles along states (K, 3)."""
        hits, problem = None if now.view is None else now.view.hits, self._problem
        return PlannedAround(
            now.things[:, :SPREAD_RATE],
            now.solids,
            problem.body_radius,
            problem.dt,
            hits=hits,
            footprint=problem.footprint,
        ).clearance(states)


class Fallback:
    """The phase that stands in for all others."""

    def __init__(
        self,
        problem: NavigationProblem,
        motions: SafeMotions,
        verification: Verification,
        rates: RateLimit,
        answers: Answers,
    ) -> None:
        self._problem, self._motions, self._verification = problem, motions, verification
        self._rates, self._answers = rates, answers

    def stop(self, now: Now, reason: str) -> Plan:
        """Drive the last safe motion on while it is clear, else brake."""
        state, history = now.state, now.state.history
        rest, here = history.rest, now.pose if now.pose_is_known else history.measured
        blocked = False
        if rest is not None and here is not None:
            # checked again from where the robot is now, and against the obstacles that are seen now
            states = self._motions.rollout(now.known.model, here, rest, history.commands)
            blocked = not self._verification.clearance(states, now) >= 0.0
            if not blocked and np.isfinite(states).all():
                return self._replay(now, states, rest, reason)
        state.trajectory = None
        # where the stop trajectory would end in an obstacle, zero is commanded at once: a robot
        # without lag stands, and one with lag brakes as hard as it can
        last = history.command
        command = np.zeros_like(last) if blocked else self._rates.ramp(last)[0]
        command = self._rates.limit(command, last)
        history.remember(command)
        inputs = np.zeros((self._problem.horizon, len(command)))
        inputs[0] = command
        finite = np.isfinite(now.pose)
        states = np.tile(np.where(finite, now.pose, 0.0), (self._problem.horizon + 1, 1))
        told = reason, GoalProgress.WAITING
        lost = not bool(finite.all())
        return self._answers.plan(now, states, inputs, PlanStatus.STOPPED, *told, pose_is_lost=lost)

    def _replay(self, now: Now, states: Array, rest: Array, reason: str) -> Plan:
        """Send the next command of the stop trajectory (T, 2), which leads along states (K, 3)."""
        rest[0] = self._rates.limit(rest[0], now.state.history.command)
        now.state.history.remember(rest[0], rest, braked=True)
        n = self._problem.horizon
        commands = np.zeros((n, rest.shape[1]))
        commands[: len(rest)] = rest[:n]
        missing = max(n + 1 - len(states), 0)
        shown = np.concatenate([states[: n + 1], np.repeat(states[-1:], missing, axis=0)])
        told = reason, GoalProgress.WAITING
        return self._answers.plan(now, shown, commands, PlanStatus.FALLBACK, *told)
