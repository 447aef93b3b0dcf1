"""The largest share of a plan that a robot can drive and still come to rest clear; what if none.

Candidates are the plan's coming command, its shares down to hard braking, and a few further
commands of the plan; each is followed by a brake. They are rolled out to rest with the model and
its past commands, and the first one that stays clear is driven (`kernels/c/safe_motion.c` has the
law). None: the plan must not be driven.

It holds as far as these are true:

- the model is wrong by less than its margins (`margins.py`), but for how late the robot answers,
  which is found while it drives (`estimate/history.py`);
- circles keep their velocity, or turn for a while, and solids stay until the robot stands; a
  standing robot can still be driven into;
- the pose is right, and every obstacle that the motion comes to is known: all are given, or those
  within `NavigationProblem.sensor_range`, or a scan has shown the place to be free;
- a robot whose model has no input history, and whose commands may change as they like (no
  `du_max`), stops within the period in which it is told to;
- margins are on: without them (``tightening=None``, the paper) no plan is refused.

What the model contradicts is rolled out anew before. Without a motion the plan is not driven:
`Fallback` follows the last safe one, or brakes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.answers import Answers
from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import (
    SPREAD_RATE,
    TINY_STEP,
    Brakes,
    Motions,
    samples_a_period,
)
from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.nmpc.qp import Trajectory
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.sqp import SQPResult
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import StepOptions, StopOptions, unit_length
from kmpc_lite.control.plan import GoalProgress, Plan, PlannedAround, PlanStatus, Task
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

OVERSPEED = 1.25
"""A robot drives at most this many times as far as its commands say, if it is only decided whether
to look more closely."""
TURN_ALLOWANCE = 1 / 150
"""How much a slow turn on the spot may move a round robot towards a thing [radii]: it must always
be able to turn free."""


class SafeMotion(NamedTuple):
    """What may be driven."""

    states: Array  # (N + 1, 3), rolled out anew where the plan was slowed
    inputs: Array  # (N, 2), whose first is the coming command
    commands: Array | None  # (T, 2) from the coming command to rest; None if no motion is clear
    slowed: bool = False  # whether the coming command is not the plan's


class SafeMotions:
    """Finds the safe motion of a plan.

    `problem`: period, outline, and how fast commands may change. `options`: what is tried, and what
    may be spent.

    Attributes: `further`: how many further commands of a plan are tried before the brake.
    """

    def __init__(self, problem: NavigationProblem, options: StopOptions) -> None:
        self._options, self._dt, self._radius = options, problem.dt, problem.body_radius
        # what chords and differences are small beside; of a point robot, too
        self._unit = unit_length(problem)
        self._footprint = problem.footprint
        self._reach = 0.0 if problem.footprint is None else problem.footprint.reach
        self._rates = RateLimit(problem)
        self.further = min(round(options.further_time / problem.dt), problem.horizon - 1)
        rates, sharpest = self._rates, problem.wheels.curvature
        changes = rates.ramp_step, rates.faster, rates.slower
        self._brakes = Brakes(*changes, sharpest, rates.longest_ramp, self.further)

    def find(self, states: Array, inputs: Array, task: Task) -> SafeMotion:
        """Find what may be driven of a plan from the present pose.

        `states`, `inputs`: the plan (N + 1, 3) and (N, 2); left as they are. `task`: what it must
        be clear of.
        """
        ramp = np.concatenate([inputs[:1], self._rates.ramp(inputs[0])])
        if task.margins is None or task.around.is_empty or self._is_far(states[0], ramp, task):
            return SafeMotion(states, inputs, ramp)
        # of a plan that is clear nothing else is rolled out, which is most of the time
        for whole in (True, False):
            motions = self._candidates(inputs, whole, task)
            clear = self._are_clear(states[0], motions, task)
            if clear.any():
                chosen = motions.commands[int(clear.argmax())]
                break
        else:
            return SafeMotion(states, inputs, None)
        if np.array_equal(chosen[0], inputs[0]):
            return SafeMotion(states, inputs, chosen)
        slower = inputs.copy()
        slower[0] = chosen[0]
        states = task.model.rollout(states[0], slower, task.past)
        return SafeMotion(states, slower, chosen, slowed=True)

    def rollout(self, model: MotionModel, here: Array, commands: Array, past: Array) -> Array:
        """States (..., T + L + 1, 3) of a motion, and of the coasting after it.

        `model`: predicts, with L past commands. `here`: pose (3,) at which it begins. `commands`:
        (..., T, 2), to zero. `past`: (L, 2) commands already sent.
        """
        if model.history:
            still = np.zeros((*commands.shape[:-2], model.history, commands.shape[-1]))
            commands = np.concatenate([commands, still], axis=-2)
        return model.rollout(here, commands, past)

    def _is_far(self, here: Array, ramp: Array, task: Task) -> bool:
        """Whether everything is farther away than the robot can come to until it stands."""
        given = np.abs(np.concatenate([task.past, ramp]))
        driven, turned = (self._dt * speeds(given).sum(axis=0)).tolist()
        far = OVERSPEED * (driven + self._reach * turned)
        time = self._dt * (len(ramp) + task.model.history)
        assert task.margins is not None and task.felt is not None
        one = np.array([driven]), np.array([turned])
        if task.rolls_on is not None:
            farther = np.abs(task.rolls_on)
            far += float(np.hypot(*farther[:2]) + self._reach * farther[2])
        far += float(task.margins.of_motions(task.felt, *one)[0]) + time * task.around.fastest()
        places = places_of(self._footprint, here)
        nearest = task.around.clearance(places[None, None], np.zeros(1), places) - self._radius
        return bool(np.minimum.reduce(nearest, axis=None, initial=np.inf) > far)

    def _stands_at_once(self, task: Task) -> bool:
        """Whether the robot stands in the period in which it is told to."""
        return not (task.model.history or self._rates.active)

    def _candidates(self, inputs: Array, whole: bool, task: Task) -> Motions:
        """What begins with a plan's coming command, or with further, slower and braking ones."""
        hardest = np.zeros_like(inputs[0])
        if self._rates.active and not whole:
            hardest = self._rates.limit(self._rates.ramp(task.last)[0], task.last)
        at_once = self._stands_at_once(task)
        return library.candidates(self._brakes, inputs, hardest, whole, at_once)

    def _are_clear(self, here: Array, motions: Motions, task: Task) -> Array:
        """Which of the motions from a pose (3,) stay clear, (C,)."""
        margins, felt, around = task.margins, task.felt, task.around
        assert margins is not None and felt is not None
        commands, radius = motions.commands, self._radius
        states = self.rollout(task.model, here, commands, task.past)
        steps = states[:, 1:] - states[:, :-1]
        distances = np.hypot(steps[..., 0], steps[..., 1])
        # what sticks out moves by turning, too
        travel = distances + self._reach * np.abs(steps[..., 2])
        longest = float(travel.max())
        count, begin = samples_a_period(longest, self._unit), places_of(self._footprint, here)
        poses = library.samples(states, count)
        if task.rolls_on is not None:
            poses += task.rolls_on
        places = places_of(self._footprint, poses).reshape(*poses.shape[:2], *begin.shape)
        times = self._dt / count * np.arange(1, poses.shape[1] + 1)
        body = at_rest = None
        if self._footprint is not None:
            body = self._footprint, poses.reshape(-1, 3)
            at_rest = self._footprint, here[None]
        clearance = around.clearance(places, times, begin, body) - radius
        needed = margins.of_motions(felt, distances, steps[..., 2]).repeat(count, axis=1)
        ends = count * (motions.ends + task.model.history)
        # of most motions this is enough to know
        error = margins.most_of_commands(felt, commands[:, 0]) + felt.pose_error
        chord = longest / count
        lost = chord * chord / (8.0 * self._unit)
        sure = library.surely_clear(clearance, needed, error, travel[:, 0], ends, lost)
        if sure[0]:
            return sure
        standing = around.clearance(begin[None, None], times, begin, at_rest) - radius
        clearance = library.between_samples(clearance, standing, places, begin, self._unit)
        slopes = around.slopes(begin, here, TINY_STEP * self._unit, self._footprint)
        errors = margins.of_commands(felt, commands[:, 0], slopes)
        # a round robot that turns slowly stays where it is: it must get free of what it touches
        free = motions.turns & (self._footprint is None)
        if self._stands_at_once(task):
            # the command's own error, towards each thing, is all that it drives
            needed[:, :count] = -np.inf
        return library.admissible(
            clearance,
            standing,
            self._options.spend_share * np.maximum(standing - felt.pose_error, 0.0),
            needed,
            np.hypot(*np.moveaxis(places - begin, -1, 0)),
            np.where(free[:, None, None], -TURN_ALLOWANCE * radius, errors),
            around.may_turn,
            motions.strict,
            ends,
            count,
            felt.pose_error,
        )


ACCEPTED_DEPTH = 2 / 15
"""How deep a plan that was rolled out may cut into an obstacle and still be driven, without margins
[radii]: the next pass mends it."""


class Verified(NamedTuple):
    """A solver's answer after its checks."""

    trajectory: Trajectory | None
    """What the next step is warm started from; None if the answer is of no use."""
    motion: Array | None
    """(T, 2) from the coming command to rest; None: the plan must not be driven."""
    reason: str  # what is wrong; empty if nothing is


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
        untold: Array,
        answers: Answers,
    ) -> None:
        self._problem, self._motions, self._verification = problem, motions, verification
        self._rates, self._untold, self._answers = RateLimit(problem), untold, answers

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
        if state.ramps is not None:
            # limits that were felt, and not told, are no reason to brake less hard
            felt = self._untold & np.isfinite(state.ramps)
            inputs[0, :-1][felt[:-1]] = 0.0
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
