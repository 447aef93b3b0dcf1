"""How much later, or how much more slowly, than its model says a robot answers.

Each period is predicted by commands that are so many periods older than they should be, for a few
such numbers. The one whose errors are the least of late, and significantly so, is how late the
robot answers: to a model that does not know of it, a pose that shows old commands is an old pose.
Where nothing is learned of the robot, it is predicted by commands that have passed through ramps,
too. One that explains its motion far better than any age, lag or gain is what it can do.
It is part of what is learned while driving: a controller that is told to adapt nothing does not
ask for it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.estimate.expected_errors import JUDGED_STEP, TOLERATED_STEP, TOLERATED_TURN
from kmpc_lite.control.estimate.history import latest_answer
from kmpc_lite.control.options import unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

MEMORY, FEWEST = 4.0, 40
"""For how long errors count [s], and for how many periods at the least."""
EVIDENCE = 12.0
"""Gain in log-likelihood that another answer must bring."""
RAMP_TIMES = np.geomspace(0.25, 6.7, 20)
"""Times from rest to the fastest command, of robots that follow by ramps [s]."""
LAGS, GAINS = np.geomspace(0.05, 0.57, 8), np.arange(0.3, 1.0, 0.1)
"""What else may slow it down: time constants [s], and shares of what is commanded."""


@dataclass(slots=True)
class LatenessState:
    """What is remembered of how the robot answers."""

    pose: Array | None = None
    """(3,) as measured a period ago; none if it was not, or if nobody knows what was sent."""
    errors: Array = field(default_factory=lambda: np.zeros((2, 0)))
    """(2, J + K) fading sums of squared errors ahead and of turns, as multiples of tolerated ones:
    by how many periods older the commands are; by ramps, lags and gains."""
    count: float = 0.0
    """How many these are, fading as they do."""
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
        periods = pose_age / problem.dt
        known = int(periods + 1e-6)
        self._age, self._dt = max(periods - known, 0.0), problem.dt
        # the newest command's period has ended as the pose is measured
        self._places = -1 - known - np.arange(latest_answer(problem.dt) + 1)
        self._fading = 1.0 - 1.0 / max(MEMORY / problem.dt, FEWEST)
        unit = unit_length(problem)
        self._judged, self._step = JUDGED_STEP * unit, TOLERATED_STEP * unit
        self._turns = problem.wheels.turns_on_the_spot
        full = np.maximum(np.abs(problem.u_min), np.abs(problem.u_max))
        # of a car steering comes between
        self._rates = full / RAMP_TIMES[self._turns * RAMP_TIMES > 2.0 * problem.dt, None]
        self._most = np.concatenate([self._rates, np.full((len(LAGS), len(full)), np.inf)])
        self._most *= problem.dt
        self._shares = np.ones((len(self._most), 1))
        self._shares[len(self._rates) :, 0] = 1.0 - np.exp(-problem.dt / LAGS)

    def see(
        self, state: LatenessState, model: MotionModel, given: Array, pose: Array | None
    ) -> bool:
        """Take in a measured pose, and tell whether the robot answers otherwise than was thought.

        Parameters
        ----------
        state : LatenessState
            Updated.
        model : MotionModel
            Predicts.
        given : ndarray
            (K, m) commands up to that of the past period, oldest first; the last one becomes what
            the robot has made of it where it is found to follow by a ramp.
        pose : ndarray or None
            (3,) as measured; none if that, or the past period's command, is not known.
        """
        before, state.pose = state.pose, pose
        places, command = self._places, given[-1]
        if state.passed is None:
            count = 0 if model.noise_model or not len(self._rates) else len(self._most)
            state.passed = np.zeros((count, len(command)))
        passed = state.passed
        if count := len(passed):
            change = self._shares * (command - passed)
            state.passed = passed + np.clip(change, -self._most, self._most)
        if before is None or pose is None:
            return False
        if math.hypot(pose[0] - before[0], pose[1] - before[1]) < self._judged:
            return False  # a robot that stands may be held
        gains = GAINS[: len(GAINS) * bool(count), None] * command
        slower = np.concatenate([0.5 * (passed + state.passed), gains])
        commands = (1.0 - self._age) * given[places] + self._age * given[places - 1]
        commands = np.concatenate([commands, slower])
        history = None
        if model.history:
            history = given[places[:, None] - np.arange(model.history, 0, -1)]
            history = np.concatenate([history, slower[:, None].repeat(model.history, axis=1)])
        predicted = model.predict(np.broadcast_to(before, (len(commands), 3)), commands, history)
        x, y, turned = (pose - predicted).T
        ahead = math.cos(before[2]) * x + math.sin(before[2]) * y
        turned -= math.tau * np.rint(turned / math.tau)
        squares = np.stack([ahead / self._step, turned / TOLERATED_TURN]) ** 2 + 1.0
        if not np.isfinite(squares).all():
            return False
        state.errors = squares + (self._fading * state.errors if state.count else 0.0)
        state.count = self._fading * state.count + 1.0
        late, was, axes = state.errors[:, : len(places)], state.found.min(), np.arange(2)
        best = late.argmin(axis=1)
        gain = 0.5 * state.count * np.log(late[axes, state.found] / late[axes, best])
        state.found = np.where(gain > EVIDENCE, best, state.found)
        if not self._turns:
            state.found[1] = state.found[0]
        return self._follows(state, given[-1]) or bool(state.found.min() != was)

    def _follows(self, state: LatenessState, command: Array) -> bool:
        """Whether a ramp explains the motion far better than all else that is known."""
        begin, end, changed = len(self._places), len(self._places) + len(self._rates), False
        passed = np.asarray(state.passed)
        known = np.full(len(command), np.inf) if state.ramps is None else state.ramps.copy()
        for errors, columns in zip(state.errors, (slice(0, -1), slice(-1, None)), strict=True):
            if len(errors) == begin:
                break
            best = begin + int(errors[begin:end].argmin())
            others = min(errors[:begin].min(), errors[end:].min())
            # told apart to a step: the slower one is safe; and sooner than a delay, for it brakes
            rates = self._rates[min(best + 1, end - 1) - begin, columns]
            likelier = 0.5 * state.count * math.log(others / errors[best]) > 0.75 * EVIDENCE
            if likelier and (rates < known[columns]).any():
                known[columns], command[columns] = rates, passed[best - begin, columns]
                errors[:] = errors.min()  # as of now nothing is known any better
                state.found, state.ramps, changed = np.zeros(2, dtype=int), known, True
        return changed
