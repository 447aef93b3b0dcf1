"""What the robot does without a plan: it follows its stop trajectory, or brakes."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.knowledge import Knowledge
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.rate_limit import RateLimit
from kmpc_lite.control.state import ControllerState
from kmpc_lite.control.step_clock import StepClock
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

    def stop(
        self,
        state: ControllerState,
        seen: Observation,
        known: Knowledge,
        reason: str,
        clock: StepClock,
        passes: int = 0,
    ) -> Plan:
        """Drive the last safe motion on while it is clear, else brake."""
        history = state.history
        rest, here = history.rest, seen.pose if seen.pose_is_known else history.measured
        blocked = False
        if rest is not None and here is not None:
            # checked again from where the robot is now, and against the obstacles that are seen now
            states = self._motions.rollout(known.model, here, rest, history.commands)
            blocked = not self._verification.clearance(states, seen) >= 0.0
            if not blocked and np.isfinite(states).all():
                return self._replay(state, seen, states, rest, reason, clock, passes)
        state.trajectory = None
        # where the stop trajectory would end in an obstacle, zero is commanded at once: a robot
        # without lag stands, and one with lag brakes as hard as it can
        last = history.command
        command = np.zeros_like(last) if blocked else self._rates.ramp(last)[0]
        command = self._rates.limit(command, last)
        history.remember(command)
        inputs = np.zeros((self._problem.horizon, len(command)))
        inputs[0] = command
        pose = np.where(np.isfinite(seen.pose), seen.pose, 0.0)
        return self._answers.plan(
            seen,
            np.tile(pose, (self._problem.horizon + 1, 1)),
            inputs,
            PlanStatus.STOPPED,
            clock,
            passes=passes,
            reason=reason,
            progress=GoalProgress.WAITING,
            pose_is_lost=not bool(np.isfinite(seen.pose).all()),
        )

    def _replay(
        self,
        state: ControllerState,
        seen: Observation,
        states: Array,
        rest: Array,
        reason: str,
        clock: StepClock,
        passes: int,
    ) -> Plan:
        """Send the next command of the stop trajectory (T, 2), which leads along states (K, 3)."""
        rest[0] = self._rates.limit(rest[0], state.history.command)
        state.history.remember(rest[0], rest)
        n = self._problem.horizon
        commands = np.zeros((n, rest.shape[1]))
        commands[: len(rest)] = rest[:n]
        missing = max(n + 1 - len(states), 0)
        shown = np.concatenate([states[: n + 1], np.repeat(states[-1:], missing, axis=0)])
        return self._answers.plan(
            seen,
            shown,
            commands,
            PlanStatus.FALLBACK,
            clock,
            passes=passes,
            reason=reason,
            progress=GoalProgress.WAITING,
        )
