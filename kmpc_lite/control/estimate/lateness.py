"""How much later than its model says a robot answers, as its motion tells it.

Each period is predicted by commands that are so many periods older than they should be, for a few
such numbers. The one whose errors are the least of late, and significantly so, is how late the
robot answers: to a model that does not know of it, a pose that shows old commands is an old pose.
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
"""Gain in log-likelihood that another number must bring."""


@dataclass(slots=True)
class LatenessState:
    """What is remembered of how late the robot answers."""

    pose: Array | None = None
    """(3,) as measured a period ago; none if it was not, or if nobody knows what was sent."""
    errors: Array = field(default_factory=lambda: np.zeros((2, 0)))
    """(2, J) fading sums of squared errors ahead and of turns by how many periods older the
    commands are, as multiples of tolerated ones."""
    count: float = 0.0
    """How many these are, fading as they do."""
    found: Array = field(default_factory=lambda: np.zeros(2, dtype=int))
    """(2,) how much later than its model says the robot drives, and turns, in periods."""
    sought: bool = False
    """Whether it is looked for."""
    periods: int = 0
    """How much later it answers: of what drives and turns differently late, the sooner."""


class Lateness:
    """Finds how old the commands are that the robot's motion shows.

    Parameters
    ----------
    problem : NavigationProblem
        Its period, and whether its robot turns on the spot: a car whose wheels are slow to turn
        does not answer late.
    pose_age : float
        How old poses are on arrival, which is known.
    """

    def __init__(self, problem: NavigationProblem, pose_age: float) -> None:
        periods = pose_age / problem.dt
        known = int(periods + 1e-6)
        self._age, self._dt = max(periods - known, 0.0), problem.dt
        # the newest command's period has ended as the pose is measured
        self._places = -1 - known - np.arange(latest_answer(problem.dt) + 1)
        self._fading = 1.0 - 1.0 / max(MEMORY / problem.dt, FEWEST)
        unit = unit_length(problem)
        self._judged = JUDGED_STEP * unit
        self._step = TOLERATED_STEP * unit
        self._axes = 2 if problem.wheels.turns_on_the_spot else 1

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
            (K, m) commands up to that of the past period, oldest first.
        pose : ndarray or None
            (3,) as measured; none if that, or the past period's command, is not known.
        """
        before, state.pose = state.pose, pose
        if before is None or pose is None:
            return False
        if math.hypot(pose[0] - before[0], pose[1] - before[1]) < self._judged:
            return False  # a robot that stands may be held
        places = self._places
        commands = (1.0 - self._age) * given[places] + self._age * given[places - 1]
        history = None
        if model.history:
            history = given[places[:, None] - np.arange(model.history, 0, -1)]
        predicted = model.predict(np.broadcast_to(before, (len(places), 3)), commands, history)
        x, y, turned = (pose - predicted).T
        ahead = math.cos(before[2]) * x + math.sin(before[2]) * y
        turned -= math.tau * np.rint(turned / math.tau)
        squares = np.stack([ahead / self._step, turned / TOLERATED_TURN]) ** 2 + 1.0
        if not np.isfinite(squares).all():
            return False
        state.errors = squares + (self._fading * state.errors if state.count else 0.0)
        state.count = self._fading * state.count + 1.0
        best, axes = state.errors.argmin(axis=1), np.arange(len(squares))
        gain = (
            0.5 * state.count * np.log(state.errors[axes, state.found] / state.errors[axes, best])
        )
        state.found = np.where(gain > EVIDENCE, best, state.found)
        before_now, state.periods = state.periods, int(state.found[: self._axes].min())
        return state.periods != before_now
