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
        """Whether a ramp explains the motion far better than all else that is known."""
        changed = False
        for axis, columns in enumerate((slice(0, -1), slice(-1, None))):
            delays, ramps, rest = least[axis]
            if not self._likelier(state, min(delays, rest), ramps, 0.75):
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
