"""Tells from the errors of past periods whether a robot does otherwise than its model says.

Adaptation needs seconds to tell a new floor from chance. Until then the errors themselves say how
wide the margins must be: the detector inflates the model's noise by the mean square of recent
errors, and calls the floor unknown where they add up to one side.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.options import MarginOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.running_mean import newest_weight
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import tube_noise
from kmpc_lite.types import Array

STANDING = 1e-9
"""Speed of a robot that cannot drive: numbers stay finite."""


@dataclass(slots=True)
class DriftState:
    """What the drift detector remembers of past periods."""

    level: float = 1.0
    """Fading mean of the squared errors, each as a multiple of what the model expects."""
    ahead: float = 0.0
    """Fading sum of the errors along the drive [m]; backwards they count with the other sign."""
    left: float = 0.0
    """The same of the errors to the left [m]."""
    ahead_variance: float = 0.0
    """Fading sum of the variances that the model expects of errors along the drive [m^2]."""
    left_variance: float = 0.0
    """The same of the errors to the left [m^2]."""
    covariance: float = 0.0
    """The same of the product of both [m^2]."""
    drifting: bool = False
    """Whether the sums are larger than chance makes them: the floor pushes to one side."""


class DriftDetector:
    """Compares measured poses with the predicted ones, by the noise that a model expects.

    Parameters
    ----------
    model : MotionModel
        Its noise model and its period.
    problem : NavigationProblem
        The robot's radius and speeds, which options are multiples of.
    options : MarginOptions
        Tolerances, and how fast the means follow.

    Attributes
    ----------
    tolerated : ndarray
        (2, 9) covariance that every model may be wrong by, to be multiplied by v^2 and omega^2.
    """

    def __init__(
        self, model: MotionModel, problem: NavigationProblem, options: MarginOptions
    ) -> None:
        self._dt, self._options = model.dt, options
        # errors of a robot that lags last: unless it is known how much, their sum tells nothing
        tube = tube_noise(model.noise_model, model.dt)
        self._sums_errors = not model.history or bool(tube.lasting.any())
        longest = options.fading_period
        self._attack = newest_weight(options.innovation_attack_time, model.dt, longest)
        self._release = newest_weight(options.innovation_release_time, model.dt, longest)
        unit = unit_length(problem)
        self._judged_step = options.judged_step * unit
        self._step_tolerance = options.step_tolerance * unit
        # of the poses at both ends of a period, and how much larger they are at speed
        measured, at_speed = tube.poses * tube.pose, tube.poses * tube.pose_by_speed
        moved = tube.white + tube.lasting
        moved[0] += at_speed
        self._by_command = [
            [float(part[i, j]) for part in (measured, *moved)]
            for i, j in ((0, 0), (1, 1), (0, 1), (2, 2))
        ]
        # a fading sum of errors that last has so many times the variance of one of white ones
        fading = options.drift_fading
        summed = tube.white + (1.0 + fading) / (1.0 - fading) * tube.lasting
        self._by_sum = [
            [float(part[i, j]) for part in (measured, at_speed, *summed)]
            for i, j in ((0, 0), (1, 1), (0, 1))
        ]
        by_distance = (options.step_tolerance_share * self._dt) ** 2
        # at rest errors are tolerated too, but what is too much of them was made while driving
        at_rest = self._step_tolerance**2 + measured.diagonal()[:2]
        self.tolerated = np.zeros((2, 9))
        usual_speed = max(options.usual_speed * fastest(problem)[0], STANDING)
        self.tolerated[0, [0, 4]] = by_distance + at_rest / usual_speed**2
        self.tolerated[1, 8] = (options.turn_tolerance_share * self._dt) ** 2
        self._expected = float(moved[0, 0, 0] + moved[0, 1, 1]) + 2.0 * by_distance

    def inflation(self, state: DriftState) -> float:
        """Return the factor of the noise's standard deviation, at least 1."""
        return float(max(1.0, state.level - self._options.innovation_calm + 1.0) ** 0.5)

    def is_unknown_floor(self, state: DriftState) -> bool:
        """Return whether the robot knows neither its floor nor how wrong it is about it."""
        limit = self._options.unknown_floor_inflation
        return state.drifting or self.inflation(state) > limit

    def carry_over(self, state: DriftState, before: DriftDetector) -> None:
        """Judge by another model from now on: it may expect what the model before did not."""
        state.level = max(1.0, state.level * before._expected / self._expected)
        state.ahead = state.left = 0.0
        state.ahead_variance = state.left_variance = state.covariance = 0.0
        state.drifting = False

    def observe(self, state: DriftState, error: Array, heading: float, command: Array) -> None:
        """Compare a past period with what was expected of it.

        Parameters
        ----------
        state : DriftState
            Updated.
        error : ndarray
            Measured less predicted pose (3,) [m, m, rad], in the map's frame; one that is not
            finite counts for nothing.
        heading : float
            At the beginning of the period [rad].
        command : ndarray
            (2,) that was held during it.
        """
        command = speeds(command)
        # also false for NaN and infinity
        if not (abs(command[0]) * self._dt >= self._judged_step and error @ error < np.inf):
            return
        # plain floats: for three numbers they are ten times as fast as arrays
        cos, sin = math.cos(heading), math.sin(heading)
        error_x, error_y, turned = error.tolist()
        ahead, left = cos * error_x + sin * error_y, cos * error_y - sin * error_x
        v, omega = command.tolist()
        own = self._own(v)
        xx, yy, xy, hh = (m + v * v * a + omega * omega * b for m, a, b in self._by_command)
        xx, yy = xx + own, yy + own
        self._update_level(state, _mahalanobis(ahead, left, xx, yy, xy), turned, hh, omega)
        if self._sums_errors:
            # backwards, a floor pushes the other way
            sign = math.copysign(1.0, v)
            self._update_sums(state, sign * ahead, sign * left, v, omega)

    def _update_level(
        self, state: DriftState, square: float, turned: float, variance: float, omega: float
    ) -> None:
        """Move the fading mean towards the period's squared error: of the position or the turn."""
        options = self._options
        turned = math.remainder(turned, 2.0 * math.pi)
        tolerated = options.turn_tolerance_share * self._dt * omega
        variance += options.turn_tolerance**2 + tolerated**2
        square = max(square, turned * turned / variance)
        change = min(float(square), options.largest_innovation) - state.level
        state.level += (self._attack if change > 0.0 else self._release) * change

    def _update_sums(
        self, state: DriftState, ahead: float, left: float, v: float, omega: float
    ) -> None:
        """Add an error and its expected variances to the fading sums, and judge them."""
        fading = self._options.drift_fading
        own = self._own(v)
        xx, yy, xy = (v * v * a + omega * omega * b for _, _, a, b in self._by_sum)
        state.ahead, state.left = fading * state.ahead + ahead, fading * state.left + left
        state.ahead_variance = fading**2 * state.ahead_variance + xx + own
        state.left_variance = fading**2 * state.left_variance + yy + own
        state.covariance = fading**2 * state.covariance + xy
        # noise of the poses does not add up: what it adds to one period, it takes from the next
        mx, my, mc = ((m + v * v * a) / (1.0 + fading) for m, a, _, _ in self._by_sum)
        drift = _mahalanobis(
            state.ahead,
            state.left,
            state.ahead_variance + mx,
            state.left_variance + my,
            state.covariance + mc,
        )
        state.drifting = drift > self._options.drift_threshold

    def _own(self, v: float) -> float:
        """Variance of a period's error that even a model without noise may have [m^2]."""
        options = self._options
        return self._step_tolerance**2 + (options.step_tolerance_share * self._dt * v) ** 2


def _mahalanobis(x: float, y: float, xx: float, yy: float, xy: float) -> float:
    """Half the squared distance of (x, y) from zero, for a covariance [[xx, xy], [xy, yy]]."""
    return 0.5 * (x * x * yy - 2.0 * x * y * xy + y * y * xx) / (xx * yy - xy * xy)
