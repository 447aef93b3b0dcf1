"""What a model expects of innovations, what they say of the floor, and how late the robot answers.

Each period is predicted by commands that are a few periods older than they should be. The age with
the least errors of late, and significantly so, is how late the robot answers: to a model that does
not know of it, a pose that shows old commands is an old pose. Where nothing is learned of the
robot, it is predicted by commands that have passed through ramps, too: one that explains its motion
far better than any age, lag or gain. A controller that is told to adapt nothing does not ask.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.clock import newest_weight
from kmpc_lite.control.estimate.history import DrivenPeriod, latest_answer
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.options import fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import TubeNoise, tube_noise
from kmpc_lite.types import Array

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
JUDGED_STEP = 1 / 30  # innovations are judged only of periods that drive at least this far [radii]
TOLERATED_STEP, TOLERATED_STEP_SHARE = 1 / 150, 0.02
"""Error of the position that every model may have in a period [radii], and as a share of what is
driven."""
LONG_PERIOD = 0.25
"""Period [s] beyond which that error grows in proportion, as the noise of a floor does."""
TOLERATED_TURN, TOLERATED_TURN_SHARE = 5e-3, 0.05
"""Error of the heading in any period [rad], and as a share of the turn."""
USUAL_SPEED = 2 / 3
"""Share of the fastest speed at which tolerated errors are taken to have been made."""
STANDING = 1e-9  # speed of a robot that cannot drive: numbers stay finite
MEMORY, FEWEST = 4.0, 40  # for how long errors count [s], and for how many periods at the least
EVIDENCE = 12.0  # gain in log-likelihood that another answer must bring
RAMP_TIMES = np.geomspace(0.25, 6.7, 20)
"""Times from rest to the fastest command, of robots that follow by ramps [s]."""
LAGS, GAINS = np.geomspace(0.05, 0.57, 8), np.arange(0.3, 1.0, 0.1)
"""What else may slow it down: time constants [s], and shares of what is commanded."""


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
            self.judge(state, error, heading, period.command, period.braked)

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
