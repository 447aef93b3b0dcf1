"""What was sent, and from where: an old pose is brought forward by it; and how late robots answer.

Each period is predicted by commands that are a few periods older than they should be: the age with
significantly the least errors is how late it answers, for a pose that shows old commands is an old
one. Where nothing is learned of the robot, it is predicted by commands behind ramps, too. A
controller that is told to adapt nothing does not ask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.options import unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn, rotate, seen_along
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel, unmodelled_delay
from kmpc_lite.types import STATES, Array

OLDEST_POSE, OLDEST_POSE_PERIODS = 2.0, 1000
"""Largest `pose_age` [s]: of an older pose nothing follows for the present one. The same in
periods: each is rolled out in every step."""
JUDGED_STEP = 1 / 30  # innovations are judged only of periods that drive at least this far [radii]
TOLERATED_STEP, TOLERATED_STEP_SHARE = 1 / 150, 0.02
"""Error of the position that every model may have in a period [radii], and as a share of what is
driven."""
TOLERATED_TURN, TOLERATED_TURN_SHARE = 5e-3, 0.05
"""Error of the heading in any period [rad], and as a share of the turn."""
MEMORY, FEWEST = 4.0, 40  # for how long errors count [s], and for how many periods at the least
EVIDENCE = 12.0  # gain in log-likelihood that another answer must bring
RAMP_TIMES = np.geomspace(0.25, 45.0, 31)
"""Times from rest to the fastest command, of robots that follow by ramps [robot's units]."""
LAGS, GAINS = np.geomspace(0.05, 0.57, 8), np.arange(0.3, 1.0, 0.1)
"""What else may slow it down: time constants [robot's units], and shares of its commands."""
LATEST_ANSWER, LATEST_PERIODS = 0.6, (6, 30)
"""How late it may answer beyond what is known [robot's units], from these to those periods."""


def oldest_pose(dt: float) -> float:
    """Largest age of a pose that is accepted at a period [s]."""
    return min(OLDEST_POSE, OLDEST_POSE_PERIODS * dt)


def whole_age(pose_age: float, model: KoopmanModel) -> float:
    """Age of a pose, and how late the robot answers beyond what its model knows [s].

    To a model without input history a pose that shows old commands is an old pose.
    """
    return max(pose_age, min(pose_age + unmodelled_delay(model), oldest_pose(model.dt)))


def latest_answer(dt: float) -> int:
    """How many periods later than known a robot may answer, and is found to."""
    return int(min(max(LATEST_ANSWER / dt, LATEST_PERIODS[0]), LATEST_PERIODS[1]))


CREEPS = 1e-3  # speed below which a command says nothing of how the wheels are steered [m/s]


class DrivenPeriod(NamedTuple):
    """The past period, as innovation and adaptation want to see it."""

    pose: Array  # (3,) at its beginning
    command: Array  # (2,) that was held during it
    earlier: Array  # (L, 2) commands before it, oldest first
    safe: bool  # whether a safe motion was driven: a plan's, or ...
    braked: bool  # ... one to rest, for want of a plan or at its goal.


@dataclass(slots=True)
class CommandHistory:
    """Commands sent, and the last period: data, in the robot's units."""

    command: Array  # (2,) the one sent last
    commands: Array  # (L, 2) that the model wants to know, oldest first
    given: Array  # (K, 2) those since the newest pose was taken, and the L before, oldest first
    curvature: float = 0.0  # of the last command that drove the robot [1/m]
    measured: Array | None = None
    """(3,) pose that was measured last, predicted since if it is lost; none before the first."""
    motion: Array | None = None
    """(T, 2) the last safe motion, from the command sent last to rest; none if there is none."""
    seen: Array | None = None  # (3,) the newest pose as it was measured; none if it was not
    beyond: Array = field(default_factory=lambda: np.zeros(STATES))
    """(3,) speeds ahead, to the left and round that measured poses show beyond the model's."""
    driven: DrivenPeriod | None = None
    """The past period; none if nobody knows what was sent, or where."""

    @classmethod
    def start(cls, problem: NavigationProblem, history: int, pose_age: float) -> CommandHistory:
        """History of a robot that stands, whose poses are so old on arrival [s]; `history` is L."""
        inputs = len(problem.u_min)
        periods = int(np.ceil(pose_age / problem.dt)) + latest_answer(problem.dt) + 2 + history
        return cls(np.zeros(inputs), np.zeros((history, inputs)), np.zeros((periods, inputs)))

    @property
    def rest(self) -> Array | None:
        """What is left of the motion (T, 2) after the command sent last; none after its end."""
        return None if self.motion is None or len(self.motion) < 2 else self.motion[1:].copy()

    def take_over(self, before: CommandHistory) -> None:
        """Go on from a history of other lengths."""
        self.command, self.curvature = before.given[-1].copy(), before.curvature
        self.measured, self.seen, self.beyond = before.measured, before.seen, before.beyond
        for part in (self.commands, self.given):
            known = min(len(part), len(before.given))
            part[len(part) - known :] = before.given[len(before.given) - known :]

    def remember(self, command: Array, motion: Array | None = None, braked: bool = False) -> None:
        """Take in the command (2,) that is sent now, and the motion (T, 2) that it begins."""
        self.command, self.motion, self.driven = command.copy(), motion, None
        self._see_curvature()
        if self.measured is not None:
            what = self.measured, self.command, self.commands.copy()
            self.driven = DrivenPeriod(*what, motion is not None, braked)
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[:-1] = earlier[1:]
                earlier[-1] = command

    def _see_curvature(self) -> None:
        speed, turn_rate = float(self.command[0]), float(self.command[-1])
        if abs(speed) > CREEPS:
            self.curvature = turn_rate / speed

    def see(self, pose: Array | None, model: MotionModel, weight: float) -> None:
        """Take in a measured pose (3,), with the newest speeds' weight; none if there is none."""
        before, driven = self.seen, self.driven
        if pose is not None and before is not None and driven is not None:
            x, y, heading = model.predict(before, driven.command, driven.earlier).tolist()
            ahead, left = rotate(float(pose[0]) - x, float(pose[1]) - y, -heading)
            turn = float(pose[2]) - heading
            beyond = np.array((ahead, left, turn - nearest_turn(turn))) / model.dt
            self.beyond = self.beyond + weight * (beyond - self.beyond)
        self.seen = None if pose is None else pose.copy()

    def rolls_on(self, age: float, measured: Array, here: Array) -> Array:
        """Displacement (3,) by which a robot comes farther than where it was brought forward to.

        As if it went on for the age of its pose [s] at the speeds at which it is seen: one that
        lags rolls so far when it is told to stand, one that answers late less. `measured` and
        `here` (3,) are where it was seen, and where it is taken to be.
        """
        going = age * (self.beyond + self._told)
        missing = going - seen_along(here - measured, measured[2])
        return _displaced(np.where(missing * going > 0.0, missing, 0.0), float(measured[2]))

    def brakes(self, heading: float, deceleration: Array, known: bool) -> Array:
        """Displacement (3,) of a robot that brakes, beyond that which its model knows of.

        From a heading [rad]; `deceleration` (3,) is ahead, to the left and round, and all speeds
        shrink by one factor. `known`: whether the model, or limits, tell how it comes to rest from
        the command sent last; else it brakes from that, too.
        """
        speeds = self.beyond if known else self.beyond + self._told
        return _displaced(0.5 * float((np.abs(speeds) / deceleration).max()) * speeds, heading)

    @property
    def _told(self) -> Array:
        """(3,) speeds ahead, to the left and round of the command sent last."""
        ahead, *left, turn = self.command.tolist()
        return np.array((ahead, left[0] if left else 0.0, turn))

    def correct(self, command: Array, problem: NavigationProblem) -> None:
        """Put what was really sent, NaN if nobody knows, in the place of the last command."""
        if not np.isfinite(command).all():
            self.driven = None
            return
        self.command = problem.within_bounds(command)
        self._see_curvature()
        for earlier in (self.commands, self.given):
            if len(earlier):
                earlier[-1] = command
        if self.driven is not None:
            self.driven = self.driven._replace(command=command.copy())


def _displaced(driven: Array, heading: float) -> Array:
    """Displacement (3,) of what is driven ahead, to the left and round, from a heading [rad]."""
    dx, dy, turn = driven.tolist()
    return np.array((*rotate(dx, dy, heading + 0.5 * turn), turn))


def advance_pose(model: MotionModel, pose: Array, sent: Array, age: float) -> Array:
    """Predict where the robot is now from where it was.

    `model`: its period is that of the commands. Dead time and motor lag that it has learned with
    its input history are part of it, not of the pose's age. `pose`: measured (3,). `sent`: commands
    already sent, oldest first, (K, 2), one per period; those before the first are taken to be zero.
    `age`: of the pose, at the moment that the next command acts [s]; not negative. Returns pose
    (3,) now.
    """
    periods = max(age, 0.0) / model.dt
    whole = int(np.ceil(periods - 1e-6))
    if whole == 0:
        return pose
    needed = whole + model.history
    commands = np.zeros((needed, model.inputs))
    known = min(len(sent), needed)
    commands[needed - known :] = sent[len(sent) - known :]
    # a pose that is older than k periods and younger than k + 1 saw a part of one command: that
    # share of the step is left to do. Taken as a straight piece of the step: off by v omega dt^2 /
    # 8 at most, 0.6 mm at 0.6 m/s, pi/4 rad/s and 0.1 s
    states = model.rollout(pose, commands[model.history :], commands[: model.history])
    first = 1.0 - (whole - periods)
    if first > 1.0 - 1e-6:
        last: Array = states[-1]
        return last
    begun: Array = pose + first * (states[1] - pose)
    if whole == 1:
        return begun
    now: Array = model.rollout(
        begun, commands[model.history + 1 :], commands[1 : model.history + 1]
    )[-1]
    return now


@dataclass(slots=True)
class LatenessState:
    """What is remembered of how the robot answers."""

    pose: Array | None = None
    """(3,) as measured a period ago; none if it was not, or if nobody knows what was sent."""
    errors: Array = field(default_factory=lambda: np.zeros((2, 0)))
    """(2, J + K) fading sums of squared errors ahead and of turns, as multiples of tolerated ones:
    by how many periods older the commands are; by ramps, lags and gains."""
    count: float = 0.0  # how many these are, fading as they do
    found: Array = field(default_factory=lambda: np.zeros(2, dtype=int))
    """(2,) how much later than its model says the robot drives, and turns, in periods: it answers
    by the sooner."""
    passed: Array | None = None
    """(R, m) what has become of the last command behind ramps and lags; none before the first, R is
    0 of a learned robot."""
    ramps: Array | None = None
    """(m,) fastest changes by which it follows its commands, where these are infinite at once."""


class Lateness:
    """Finds how old the commands are that the robot's motion shows."""

    def __init__(self, problem: NavigationProblem, pose_age: float) -> None:
        dt = problem.dt
        periods = pose_age / dt
        known = int(periods + 1e-6)
        self._age = max(periods - known, 0.0)
        # the newest command's period has ended as the pose is measured
        self._places = -1 - known - np.arange(latest_answer(dt) + 1)
        self._fading = 1.0 - 1.0 / max(MEMORY / dt, FEWEST)
        unit = unit_length(problem)
        self._judged, self._step = JUDGED_STEP * unit, TOLERATED_STEP * unit
        self._whole_turn = math.tau / TOLERATED_TURN
        self._turns = problem.wheels.turns_on_the_spot
        full = np.maximum(np.abs(problem.u_min), np.abs(problem.u_max))
        # of a car steering comes between
        self._rates = full / RAMP_TIMES[self._turns * RAMP_TIMES > 2.0 * dt, None]
        self._most = dt * np.concatenate([self._rates, np.full((len(LAGS), len(full)), np.inf)])
        self._kinds = np.cumsum((0, len(self._places), len(self._rates)))
        self._shares = np.append(np.ones(len(self._rates)), 1.0 - np.exp(-dt / LAGS))[:, None]

    def see(
        self, state: LatenessState, model: MotionModel, given: Array, pose: Array | None
    ) -> bool:
        """Take in a measured pose, and tell whether the robot answers otherwise than was thought.

        `state`: updated. `model`: predicts. `given`: (K, m) commands up to that of the past period,
        oldest first; the last one becomes what the robot has made of it where it is found to follow
        by a ramp. `pose`: (3,) as measured; none if that, or the past period's command, is not
        known.
        """
        before, state.pose = state.pose, pose
        command, late = given[-1], len(self._places)
        if state.passed is None:
            count = 0 if model.noise_model or not len(self._rates) else len(self._most)
            state.passed = np.zeros((count, len(command)))
        passed = state.passed
        if count := len(passed):
            change = self._shares * (command - passed)
            np.minimum(np.maximum(change, -self._most, out=change), self._most, out=change)
            state.passed = passed + change
        if before is None or pose is None or math.dist(pose[:2], before[:2]) < self._judged:
            return False  # a robot that stands may be held
        commands = np.empty((late + count + len(GAINS) * bool(count), len(command)))
        commands[:late] = given[self._places]
        if self._age:
            commands[:late] += self._age * (given[self._places - 1] - commands[:late])
        if count:
            commands[late : late + count] = 0.5 * (passed + state.passed)
            commands[late + count :] = GAINS[:, None] * command
        history = None
        if model.history:
            history = commands[:, None].repeat(model.history, axis=1)
            history[:late] = given[self._places[:, None] - np.arange(model.history, 0, -1)]
        # ahead, and of turns: one product takes a third of the time of `geometry.seen_along`
        ahead = math.cos(before[2]) / self._step, math.sin(before[2]) / self._step
        along = np.array(((ahead[0], 0.0), (ahead[1], 0.0), (0.0, 1.0 / TOLERATED_TURN)))
        errors = (pose - model.predict(before, commands, history)) @ along
        errors[:, 1] -= self._whole_turn * np.rint(errors[:, 1] / self._whole_turn)
        squares = (errors * errors).T + 1.0
        if not np.add.reduce(squares, axis=None) < math.inf:
            return False
        state.errors = squares + (self._fading * state.errors if state.count else 0.0)
        state.count = self._fading * state.count + 1.0
        # the least of delays, of ramps, and of what else may slow it down
        kinds = self._kinds if count else self._kinds[:1]
        least = np.minimum.reduceat(state.errors, kinds, axis=1).tolist()
        was = int(state.found.min())
        for axis, (delays, *_) in enumerate(least):
            if self._likelier(state, state.errors.item(axis, state.found[axis]), delays, 1.0):
                state.found[axis] = int(state.errors[axis, :late].argmin())
        if not self._turns:
            state.found[1] = state.found[0]
        follows = bool(count) and self._follows(state, given[-1], least)
        return follows or int(state.found.min()) != was

    def _likelier(self, state: LatenessState, errors: float, less: float, share: float) -> bool:
        """Whether fading sums of errors tell two answers apart, by a share of the evidence."""
        return 0.5 * state.count * math.log(errors / less) > share * EVIDENCE

    def _follows(self, state: LatenessState, command: Array, least: list[list[float]]) -> bool:
        """Whether a ramp explains the motion far better than all else; a second axis needs less."""
        changed = False
        for axis, columns in enumerate((slice(0, -1), slice(-1, None))):
            delays, ramps, rest = least[axis]
            second = state.ramps is not None and np.isinf(state.ramps[columns]).all()
            if not self._likelier(state, min(delays, rest), ramps, 0.1 if second else 0.5):
                continue
            best = int(state.errors[axis, self._kinds[1] : self._kinds[2]].argmin())
            # told apart to a step: the slower one is safe; and sooner than a delay, for it brakes
            rates = self._rates[min(best + 1, len(self._rates) - 1), columns]
            known = np.full(len(command), np.inf) if state.ramps is None else state.ramps.copy()
            if (rates < known[columns]).any():
                known[columns], command[columns] = rates, np.asarray(state.passed)[best, columns]
                # as of now nothing is known any better
                state.errors[axis] = state.errors[axis].min()
                state.found, state.ramps, changed = np.zeros(2, dtype=int), known, True
        return changed
