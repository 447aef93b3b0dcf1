"""The innovation: by how much a measured pose differs from the one that the model predicted.

A small one is accepted, and the robot is taken to be between both poses, each weighed by its noise:
a Kalman filter of the pose alone. With a larger one the noise that margins are made from grows, by
a fading mean of squares, and the floor counts as unknown if they add up to one side. One beyond all
that commands, slip and noise can do says that the pose has jumped: the place is predicted from the
last pose that was believed, until one comes back to it, or poses have agreed for long enough.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.clock import newest_weight
from kmpc_lite.control.estimate.history import (
    JUDGED_STEP,
    TOLERATED_STEP,
    TOLERATED_STEP_SHARE,
    TOLERATED_TURN,
    TOLERATED_TURN_SHARE,
    CommandHistory,
    DrivenPeriod,
)
from kmpc_lite.control.options import PoseOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import nearest_turn, rotate
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import TubeNoise, tube_noise
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

TURN_SLIP = 2.5
"""Share of a commanded turn by which a turn may differ: adaptation learns such turns."""
SLIP_MEMORY = 0.5  # within this time a faster command in the past fades that may still act [s]
NOTHING = 0.0, 0.0


@dataclass(slots=True)
class InnovationState:
    """What is remembered of past innovations. Pairs are a position's and a heading's."""

    error: Array | None = None
    """(3,) measured less predicted pose after a period; none if that tells nothing."""
    level: float = 1.0  # fading mean of their squares, each as a multiple of what the model expects
    ahead: float = 0.0
    """Fading sum of those along the drive [m]; backwards they count with the other sign."""
    left: float = 0.0  # the same to the left [m]
    ahead_variance: float = 0.0
    """Fading sum of the variances that the model expects along the drive [m^2]."""
    left_variance: float = 0.0  # the same to the left [m^2]
    covariance: float = 0.0  # the same of the product of both [m^2]
    drifting: bool = False
    """Whether the sums are larger than chance makes them: the floor pushes to one side."""
    believed: Array | None = None
    """(3,) predicted since the last pose that was believed; None: poses are believed."""
    jump: tuple[float, float] = NOTHING  # size of the jump
    unseen: tuple[float, float] = NOTHING
    """By how much the last pose may be off: slip since one came."""
    strayed: tuple[float, float] = NOTHING
    """By how much the believed pose may be off: slip since the jump."""
    agreed: float = 0.0  # for how long poses have agreed with each other
    elsewhere: bool = False
    """Whether in this step a doubt has ended otherwise than by a pose that came back."""
    pace: tuple[float, float] = NOTHING  # fastest commands of late, v and omega
    estimate: PoseEstimate | None = None
    """Where the robot is, from measured and predicted poses; none while a pose is doubted."""


class Innovation:
    """Compares poses with what was predicted, and tells those that have jumped."""

    def __init__(self, problem: NavigationProblem, options: PoseOptions) -> None:
        self._dt = problem.dt
        self._options = lengths_from_radii(options, unit_length(problem))
        self._fading = math.exp(-problem.dt / SLIP_MEMORY)

    def see(
        self,
        state: InnovationState,
        history: CommandHistory,
        model: MotionModel,
        noise: tuple[float, float],
        pose: Array | None,
    ) -> Array | None:
        """Take in a pose (3,), and tell where the robot is instead if it is doubted.

        `state`: updated. `history`: what was sent in the past period, which is left out of all that
        learns if a pose jumped or is lost; remembers the pose. `model`: predicts. `noise`: what
        measured poses add in position [m] and heading [rad]. `pose`: measured; none if it is lost,
        which others take care of. Returns (3,) the predicted pose; None if the measured one is
        believed.
        """
        before, doubted = history.driven, state.believed is not None
        history.measured, state.error, state.elsewhere = pose, None, False
        if before is None:
            # nobody knows what was sent, or where the robot was
            _give_up(state)
            return None
        slip = self._slip(state, before.command)
        unseen = _added(state.unseen, slip)
        step = model.predict(before.pose, before.command, before.earlier)
        places = step
        if state.believed is not None:
            state.believed = model.predict(state.believed, before.command, before.earlier)
            state.strayed = _added(state.strayed, slip)
            places = step + state.believed
        if not np.isfinite(places).all():
            _give_up(state)  # a model that drifts has been followed for too long
            return None
        was_seen = state.unseen == NOTHING
        if pose is None or not was_seen:
            history.driven = None
        if pose is None:
            history.measured, state.unseen = step, unseen
            return None
        state.unseen = NOTHING
        size = _size(pose - step)
        options = self._options
        bounds = (
            max(options.tolerated, noise[0]) + unseen[0],
            max(options.tolerated_turn, noise[1]) + unseen[1],
        )
        agrees = _within(size, bounds)
        if not doubted and (agrees or not options.agreement):
            if was_seen and before.safe:
                state.error = pose - step
            return None
        # what happens from pose to pose then tells nothing of the floor
        history.driven = None
        if state.believed is None:
            state.believed, state.jump = step, size
            state.agreed, state.strayed = 0.0, unseen
            return step
        state.agreed = state.agreed + self._dt if agrees else 0.0
        far = bounds[0] + state.strayed[0], bounds[1] + state.strayed[1]
        near = _within(_size(pose - state.believed), far)
        # what comes back must jump, too; what does not is not back, however near
        back, state.elsewhere = near and not agrees, state.agreed >= options.agreement
        if back or state.elsewhere:
            state.believed = None
        return state.believed

    def _slip(self, state: InnovationState, command: Array) -> tuple[float, float]:
        """How far slip may lead away in a period."""
        (v, omega), (fast, turning) = speeds(command).tolist(), state.pace
        state.pace = max(abs(v), self._fading * fast), max(abs(omega), self._fading * turning)
        dt = self._dt
        return self._options.slip * dt * state.pace[0], TURN_SLIP * dt * state.pace[1]


def _give_up(state: InnovationState) -> None:
    """Predict no longer: the pose is believed as it comes."""
    state.elsewhere = state.believed is not None
    state.believed, state.unseen = None, NOTHING


def _added(strayed: tuple[float, float], slip: tuple[float, float]) -> tuple[float, float]:
    """By how much a pose may be off with another period's independent slip."""
    return math.hypot(strayed[0], slip[0]), math.hypot(strayed[1], slip[1])


def _size(error: Array) -> tuple[float, float]:
    """Distance and angle of an error (3,)."""
    x, y, turned = error.tolist()
    return math.hypot(x, y), abs(math.remainder(turned, math.tau))


def _within(size: tuple[float, float], bounds: tuple[float, float]) -> bool:
    return size[0] <= bounds[0] and size[1] <= bounds[1]


class PoseEstimate(NamedTuple):
    """A pose, and how sure it is."""

    pose: Array  # (3,)
    covariance: Array  # (3, 3), in the robot's frame

    @property
    def deviation(self) -> float:
        """Standard deviation of each coordinate [m]."""
        return math.sqrt(0.5 * float(self.covariance[0, 0] + self.covariance[1, 1]))


def estimate(
    last: PoseEstimate | None,
    period: DrivenPeriod | None,
    model: MotionModel,
    moved: Array,
    measured: Array,
    pose: Array,
) -> PoseEstimate:
    """Estimate where the robot is.

    `last`: a period ago; none if nothing is known of that. `period`: what was commanded since; none
    if nobody knows. `model`: predicts. `moved`, `measured`: covariances (3, 3) of the motion in a
    period, and of a measured pose, in the robot's frame. `pose`: (3,) as measured now.
    """
    if last is None or period is None:
        return PoseEstimate(pose, measured)
    predicted = model.predict(last.pose, period.command, period.earlier)
    if not np.isfinite(predicted).all():
        return PoseEstimate(pose, measured)
    x, y, heading = predicted.tolist()
    dx, dy, turned = (predicted - last.pose).tolist()
    # the last error in the frame that the robot has turned to: one of its heading leads aside
    ahead, left = rotate(dx, dy, -heading)
    cos, sin = math.cos(turned), math.sin(turned)
    carried = np.array(((cos, sin, -left), (-sin, cos, ahead), (0.0, 0.0, 1.0)))
    covariance = carried @ last.covariance @ carried.T + moved
    gain = np.linalg.solve(covariance + measured, covariance).T
    off_x, off_y, off_turn = (pose - predicted).tolist()
    off_turn -= float(nearest_turn(off_turn))
    ahead, left, turn = (gain @ (*rotate(off_x, off_y, -heading), off_turn)).tolist()
    dx, dy = rotate(ahead, left, heading)
    # the heading stays within half a turn of the measured one
    found = np.array((x + dx, y + dy, float(pose[2]) - off_turn + turn))
    left_over = covariance - gain @ covariance
    return PoseEstimate(found, 0.5 * (left_over + left_over.T))


CALM = 2.5
"""Fading mean of squared innovations, in expected ones, up to which noise stays as it is: slip with
heavy tails exceeds it in one period of ten."""
LARGEST = 400.0  # largest square that counts: a larger one is a broken measurement
ATTACK_TIME, RELEASE_TIME, FADING_PERIOD = 0.5, 1.0, 0.1
"""Memory of that mean if the newest innovation is larger, and if it is smaller [s]. Periods longer
than the last count as this, so that five innovations count at the least, and ten as they shrink."""
UNKNOWN_INFLATION = 3.0
"""The floor is unknown if errors are more than this many times as large as the model expects."""
FORGETTING_TIME = 10.0
"""Memory of that mean while a robot stands or creeps [s]: one that stands for what it once felt
would never find out."""
DRIFT_FADING, DRIFT_THRESHOLD = 0.8, 6.0
"""Factor by which the sum of innovations fades per period, and its square, as a multiple of the
expected one, beyond which the floor pushes to one side: a single one tells little."""
LONG_PERIOD = 0.25
"""Period [s] beyond which that error grows in proportion, as the noise of a floor does."""
USUAL_SPEED = 2 / 3
"""Share of the fastest speed at which tolerated errors are taken to have been made."""
STANDING = 1e-9  # speed of a robot that cannot drive: numbers stay finite


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
            self.judge(state, state.error, float(period.pose[2]), period.command, period.braked)

    def judge(
        self, state: InnovationState, error: Array, heading: float, command: Array, braked: bool
    ) -> None:
        """Take in the innovation (3,) of a period: measured less predicted, in the map frame.

        One that is not finite counts for nothing. `heading` [rad] was that at its beginning,
        `command` (m,) was held. A robot that `braked` shows its lag, too: that may calm, but not
        alarm.
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
        if braked and square > state.level:
            return
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


def _mahalanobis(x: float, y: float, xx: float, yy: float, xy: float) -> float:
    """Half the squared distance of (x, y) from zero, for a covariance [[xx, xy], [xy, yy]]."""
    return 0.5 * (x * x * yy - 2.0 * x * y * xy + y * y * xx) / (xx * yy - xy * xy)
