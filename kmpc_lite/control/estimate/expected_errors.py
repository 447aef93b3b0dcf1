"""What a model expects of innovations, and what they say of the floor."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.clock import newest_weight
from kmpc_lite.control.estimate.history import DrivenPeriod
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.options import fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import TubeNoise, tube_noise
from kmpc_lite.types import Array

CALM = 2.5
"""Fading mean of squared innovations, as a multiple of the expected one, up to which noise stays as
it is: slip with heavy tails exceeds it in one period of ten."""
LARGEST = 400.0
"""Largest squared innovation that counts, as a multiple of the expected one: a larger one is a
broken measurement."""
ATTACK_TIME, RELEASE_TIME, FADING_PERIOD = 0.5, 1.0, 0.1
"""Memory of that mean if the newest innovation is larger, and if it is smaller [s]. Periods longer
than the last count as this, so that five innovations count at the least, and ten as they shrink."""
UNKNOWN_INFLATION = 3.0
"""The floor is unknown if errors are more than this many times as large as the model expects."""
FORGETTING_TIME = 10.0
"""Memory of that mean while nothing is learned of the floor, for the robot stands or creeps [s]: a
robot that stands for what it once felt would never find out."""
DRIFT_FADING, DRIFT_THRESHOLD = 0.8, 6.0
"""Factor by which the sum of innovations fades per period, and its square, as a multiple of the
expected one, beyond which the floor pushes to one side: a single innovation tells little among
noisy poses. The more add up, the smaller is what counts; robots that lag would take their own floor
for an unknown one."""
JUDGED_STEP = 1 / 30
"""Innovations are judged only of periods that drive at least this far [radii]."""
TOLERATED_STEP, TOLERATED_STEP_SHARE = 1 / 150, 0.02
"""Error of the position that every model may have in a period [radii], and as a share of what is
driven."""
LONG_PERIOD = 0.25
"""Period [s] beyond which that error grows in proportion, as the noise of a floor does."""
TOLERATED_TURN, TOLERATED_TURN_SHARE = 5e-3, 0.05
"""Error of the heading in any period [rad], and as a share of the turn."""
USUAL_SPEED = 2 / 3
"""Share of the fastest speed at which tolerated errors are taken to have been made."""
STANDING = 1e-9
"""Speed of a robot that cannot drive: numbers stay finite."""


class ExpectedErrors:
    """What a model expects of innovations, and how it judges them.

    `model`: its noise model and its period. `problem`: the robot's radius and speeds.

    Attributes: `tolerated`: (2, 9) covariance that every model may be wrong by, to be multiplied by
    v^2 and omega^2.
    """

    def __init__(self, model: MotionModel, problem: NavigationProblem) -> None:
        self._dt, unit = model.dt, unit_length(problem)
        tube = tube_noise(model.noise_model, model.dt)
        # errors of a robot that lags last: unless it is known how much, their sum tells nothing
        self._sums = not model.history or bool(tube.lasting.any())
        self._attack, self._release = (
            newest_weight(time, model.dt, FADING_PERIOD) for time in (ATTACK_TIME, RELEASE_TIME)
        )
        # how much of a period they take is not known
        self._ramps_are_given = model.noise_model is None and model.history == 1
        self._forgetting = newest_weight(FORGETTING_TIME, model.dt, FADING_PERIOD)
        longer = max(1.0, model.dt / LONG_PERIOD)
        self._judged_step, self._step = JUDGED_STEP * unit, longer * TOLERATED_STEP * unit
        self._by_command = _entries(tube, tube.white + tube.lasting)
        # a fading sum of errors that last has so many times the variance of one of white ones
        lasting = (1.0 + DRIFT_FADING) / (1.0 - DRIFT_FADING) * tube.lasting
        self._by_sum = _entries(tube, tube.white + lasting)
        by_distance = (TOLERATED_STEP_SHARE * self._dt) ** 2
        # at rest errors are tolerated, too, but what is too much of them was made while driving
        at_rest = self._step**2 + tube.poses * tube.pose.diagonal()[:2]
        self.tolerated = np.zeros((2, 9))
        usual_speed = max(USUAL_SPEED * fastest(problem)[0], STANDING)
        self.tolerated[0, [0, 4]] = by_distance + at_rest / usual_speed**2
        self.tolerated[1, 8] = (TOLERATED_TURN_SHARE * self._dt) ** 2
        self._whole = sum(by_v + at_v for _, at_v, by_v, _ in self._by_command[:2])
        self._whole += 2.0 * by_distance

    def own(self, v: float, omega: float) -> tuple[float, float]:
        """Variances of the position, each way, and of the heading that every model may err by."""
        turn = TOLERATED_TURN_SHARE * self._dt * omega
        step = TOLERATED_STEP_SHARE * self._dt * v
        return self._step**2 + step**2, TOLERATED_TURN**2 + turn**2

    def inflation(self, state: InnovationState) -> float:
        """Return the factor of the noise's standard deviation, at least 1."""
        return float(max(1.0, state.level - CALM + 1.0) ** 0.5)

    def is_unknown_floor(self, state: InnovationState) -> bool:
        """Return whether the robot knows neither its floor nor how wrong it is about it."""
        return state.drifting or self.inflation(state) > UNKNOWN_INFLATION

    def carry_over(self, state: InnovationState, before: ExpectedErrors) -> None:
        """Judge by another model from now on: it may expect what the model before did not."""
        state.level = max(1.0, state.level * before._whole / self._whole)
        state.ahead = state.left = 0.0
        state.ahead_variance = state.left_variance = state.covariance = 0.0
        state.drifting = False

    def see(self, state: InnovationState, period: DrivenPeriod | None) -> None:
        """Take in the innovation of a period, or let one pass that tells nothing of the floor."""
        if state.error is None or period is None:
            state.level += self._forgetting * min(1.0 - state.level, 0.0)
        else:
            error, heading = state.error, float(period.pose[2])
            if self._ramps_are_given:
                change = self._dt * (speeds(period.command) - speeds(period.earlier[-1]))
                error = _unexplained(error, heading, change)
            self.judge(state, error, heading, period.command)

    def judge(self, state: InnovationState, error: Array, heading: float, command: Array) -> None:
        """Take in the innovation (3,) of a period: measured less predicted, in the map frame.

        One that is not finite counts for nothing. `heading` [rad] was that at the beginning of the
        period, `command` (m,) was held during it.
        """
        command = speeds(command)
        # also false for NaN and infinity
        if not (abs(command[0]) * self._dt >= self._judged_step and error @ error < np.inf):
            state.level += self._forgetting * min(1.0 - state.level, 0.0)
            return
        # plain floats: for three numbers they are ten times as fast as arrays
        cos, sin = math.cos(heading), math.sin(heading)
        (x, y, turned), (v, omega) = error.tolist(), command.tolist()
        ahead, left = cos * x + sin * y, cos * y - sin * x
        turned = math.remainder(turned, math.tau)
        own, turn = self.own(v, omega)
        xx, yy, xy, hh = (
            m + v * v * (s + a) + omega * omega * b for m, s, a, b in self._by_command
        )
        hh += turn
        square = max(_mahalanobis(ahead, left, xx + own, yy + own, xy), turned * turned / hh)
        change = min(square, LARGEST) - state.level
        state.level += (self._attack if change > 0.0 else self._release) * change
        if not self._sums:
            return
        sign = math.copysign(1.0, v)  # backwards, a floor pushes the other way
        fading = DRIFT_FADING
        state.ahead = fading * state.ahead + sign * ahead
        state.left = fading * state.left + sign * left
        xx, yy, xy = (v * v * a + omega * omega * b for _, _, a, b in self._by_sum[:3])
        state.ahead_variance = fading**2 * state.ahead_variance + xx + own
        state.left_variance = fading**2 * state.left_variance + yy + own
        state.covariance = fading**2 * state.covariance + xy
        # noise of the poses does not add up: what it adds to one period, it takes from the next
        mx, my, mc = ((m + v * v * s) / (1.0 + fading) for m, s, _, _ in self._by_sum[:3])
        drift = _mahalanobis(
            state.ahead,
            state.left,
            state.ahead_variance + mx,
            state.left_variance + my,
            state.covariance + mc,
        )
        state.drifting = drift > DRIFT_THRESHOLD


def _entries(tube: TubeNoise, moved: Array) -> list[tuple[float, float, float, float]]:
    """Variances ahead, left, of their product and of turns: of both poses, more at speed, moved."""
    measured, at_speed = tube.poses * tube.pose, tube.poses * tube.pose_by_speed
    return [
        (float(measured[ij]), float(at_speed[ij]), float(moved[0][ij]), float(moved[1][ij]))
        for ij in ((0, 0), (1, 1), (0, 1), (2, 2))
    ]


def _unexplained(error: Array, heading: float, change: Array) -> Array:
    """What is left of an error (3,) by a change of the command that comes half a period sooner.

    `change` (2,) is how far it leads in a period; a robot that follows at once is ahead of one that
    follows by a ramp.
    """
    cos, sin = math.cos(heading), math.sin(heading)
    turned = math.remainder(float(error[2]), math.tau)
    ahead, turn = (
        min(max(e, min(0.5 * c, 0.0)), max(0.5 * c, 0.0))
        for e, c in zip((cos * error[0] + sin * error[1], turned), change.tolist(), strict=True)
    )
    left: Array = error - np.array((ahead * cos, ahead * sin, turn))
    return left


def _mahalanobis(x: float, y: float, xx: float, yy: float, xy: float) -> float:
    """Half the squared distance of (x, y) from zero, for a covariance [[xx, xy], [xy, yy]]."""
    return 0.5 * (x * x * yy - 2.0 * x * y * xy + y * y * xx) / (xx * yy - xy * xy)
