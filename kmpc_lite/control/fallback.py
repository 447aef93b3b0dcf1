"""What the robot does without a plan: it follows its stop trajectory, or brakes."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.now import Now
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.stop.safe_motion import SafeMotions
from kmpc_lite.control.verification import Verification
from kmpc_lite.types import Array


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
        now.state.history.remember(rest[0], rest)
        n = self._problem.horizon
        commands = np.zeros((n, rest.shape[1]))
        commands[: len(rest)] = rest[:n]
        missing = max(n + 1 - len(states), 0)
        shown = np.concatenate([states[: n + 1], np.repeat(states[-1:], missing, axis=0)])
        told = reason, GoalProgress.WAITING
        return self._answers.plan(now, shown, commands, PlanStatus.FALLBACK, *told)
