"""The errors that a model expects of itself, and how much larger they are on an unknown floor.

The noise of one period grows with its command, ``v^2 white[0] + omega^2 white[1]``, and so do the
errors that last longer than a plan. Innovations inflate both; quantiles turn them into
distances. A (2, 9) array holds two such covariances (3, 3), in the robot's frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.control.estimate.expected_errors import ExpectedErrors
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.kernels.records import Noise
from kmpc_lite.control.options import MarginOptions, fastest
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import feedback_delay, tube_noise
from kmpc_lite.types import STATES, Array

SOLVER_MARGIN = 1 / 30
"""Added to every margin [radii]: what a QP that is stopped at its tolerance, and linearised once,
may leave of a half-plane."""
STEP_QUANTILE_LIMIT, ADAPTED_STEP_QUANTILE_LIMIT = 2.0, 3.0
"""The margin of a single command, in standard deviations, is at most this many times that of a
plan, and with an adapted model: slip with exponential tails needs 1.9 and 2.6 times as many; a log
whose pose jumps would ask for nonsense."""
ADAPTED_SHARE = 0.1
"""Share of the risk of a single command that is taken with an adapted model: it knows its floor
from a few seconds only."""
ADDS_UP = 9.0
"""Periods for which an error that lasts adds up until measured poses have told it."""
HEADING = 8
"""Place of the heading's variance in a covariance (9,)."""
UNKNOWN_FLOOR_SLIP = 0.35
"""Standard deviation of a command's error on an unknown floor, as a share of what it drives: a slip
of 0.2 pushes farther than five times that once in ten thousand periods."""


class InflatedNoise(NamedTuple):
    """Covariances (2, 9) of a period, by v^2 and by omega^2."""

    plan: Array
    """Of the later periods of a plan."""
    lasting: Array
    """Of errors common to all periods of a plan, in a single one."""
    command: Array
    """Of the coming period: larger on an unknown floor."""
    spreads: bool
    """Whether there is any noise in a plan."""


class FeltNoise(NamedTuple):
    """The noise of a model as inflated by past innovations; worked out once a step."""

    tube: Noise
    """Of the later periods of a plan, as its margins follow from it."""
    widest: float
    """Margin that no plan within the command bounds exceeds [m]."""
    command: Array
    """(2, 9) covariances (3, 3) of the coming period, to be multiplied by v^2 and by omega^2, in
    the robot's frame: larger on an unknown floor."""
    position_errors: Array
    """(4,) variances of the coming period by v^2 and by omega^2, then what lasts of them: of the
    position, in all directions together [m^2] ..."""
    heading_errors: Array
    """... and of the heading [rad^2], as `kernels.stop_errors` takes them."""
    command_errs: bool
    """Whether there is any noise in the coming period."""
    pose_error: float
    """Quantile of how far the pose is off [m]: only what a clearance has beyond it is sure. Near an
    obstacle every step may use up a share of its clearance; with one that is not sure, many steps
    would end in the obstacle."""


class ModelNoise:
    """Noise of a model, and the quantiles by which it is kept away from obstacles.

    `model`: its noise model; without one there is only what innovations add. `problem`: the robot's
    radius and speeds. `options`: risks. `adapted`: whether the model was corrected while driving,
    and knows its floor from a few seconds. Raises ProblemError for a damaged table of quantiles in
    the model.

    Attributes: `tube`: what measured poses add, and what the floor does. `delay`: periods until the
    feedback acts. `lasts`: whether the model knows errors that last longer than a plan. `quantile`,
    `step_quantile`: how many standard deviations the margins of plans, and those of single
    commands, are. `pose_errors`: by how much two measured poses may err together, in position [m]
    and heading [rad]. `expected_errors`: judges past periods by this noise.
    """

    def __init__(
        self,
        model: MotionModel,
        problem: NavigationProblem,
        options: MarginOptions,
        adapted: bool = False,
    ) -> None:
        self.dt, self.delay = model.dt, feedback_delay(model)
        self.tube = tube_noise(model.noise_model, model.dt)
        self._white = np.ascontiguousarray(self.tube.white.reshape(2, 9))
        self._lasting = np.ascontiguousarray(self.tube.lasting.reshape(2, 9))
        self.lasts = bool(self._lasting.any())
        self._learned = model.noise_model is not None
        self._fastest = fastest(problem)[0]
        self._unknown_floor_variance = (UNKNOWN_FLOOR_SLIP * model.dt) ** 2
        self.expected_errors = ExpectedErrors(model, problem)
        risk = options.risk
        info = model.info
        # a log that the model fits to rounding says nothing about the errors on a real floor
        if model_quantile(info, risk) < default_quantile(risk):
            info = {}
        self.quantile = model_quantile(info, risk)
        step_risk, limit = options.step_risk, STEP_QUANTILE_LIMIT
        if adapted:
            step_risk, limit = ADAPTED_SHARE * step_risk, ADAPTED_STEP_QUANTILE_LIMIT
        step_quantile = max(self.quantile, model_quantile(info, step_risk))
        self.step_quantile = min(step_quantile, limit * self.quantile)
        self.pose_errors = self._pose_errors()

    def _pose_errors(self) -> tuple[float, float]:
        """Quantiles of the pose's noise in position and heading, of both ends of a period."""
        pose = self.tube.poses * (self.tube.pose + self._fastest**2 * self.tube.pose_by_speed)
        position, heading = float(pose[0, 0] + pose[1, 1]), float(pose[2, 2])
        return (
            self.step_quantile * math.sqrt(max(position, 0.0)),
            self.step_quantile * math.sqrt(max(heading, 0.0)),
        )

    def of_pose(self, state: InnovationState) -> tuple[Array, Array] | None:
        """Covariances (3, 3) of a period's motion and of a measured pose, in the robot's frame.

        Of the fastest commands of late: a robot that lags still drives. Errors that last add up.
        None where poses are measured better than any period can be predicted.
        """
        v, omega = state.pace
        errors, tube = self.expected_errors, self.tube
        noise = self.inflated(errors.inflation(state), errors.is_unknown_floor(state))
        measured = 0.5 * tube.poses * (tube.pose + v * v * tube.pose_by_speed)
        moved = noise.command + ADDS_UP * noise.lasting
        moved = (v * v * moved[0] + omega * omega * moved[1]).reshape(STATES, STATES)
        own, turn = errors.own(v, omega)
        moved.flat[:: STATES + 1] += own, own, turn
        better = all(measured.item(i, i) <= moved.item(i, i) for i in range(STATES))
        return None if better else (moved, measured)

    def inflated(self, inflation: float, unknown_floor: bool) -> InflatedNoise:
        """Scale the noise; inflated noise gets the errors that every model may have added to it."""
        plan, lasting = self._white, self._lasting
        if inflation != 1.0:
            tolerated = self.expected_errors.tolerated
            plan = inflation**2 * self._white + (inflation**2 - 1.0) * tolerated
        if self.lasts:
            lasting = inflation**2 * lasting
        command = plan + lasting
        if unknown_floor:
            command[0, [0, 4]] = np.maximum(command[0, [0, 4]], self._unknown_floor_variance)
        return InflatedNoise(plan, lasting, command, self._learned or inflation > 1.0)


def trace(noise: Array) -> tuple[float, float]:
    """Variance of the position by v^2 and by omega^2, of covariances (2, 9)."""
    by_speed, by_turn_rate = (noise[:, 0] + noise[:, 4]).tolist()
    return by_speed, by_turn_rate


def default_quantile(risk: float) -> float:
    """Quantile for noise that was never calibrated.

    It is the larger of two quantiles: of a normal distribution in the plane, and of one with
    exponential tails.
    """
    return float(max(np.sqrt(-2.0 * np.log(risk)), np.log(2.0 / risk) - 1.0))


def model_quantile(info: Mapping[str, Any], risk: float) -> float:
    """Look a risk up in the table that calibration left in a model.

    Between its rows, and beyond them, the quantile is linear in ``log(1 / risk)``.
    A risk smaller than the held-out drives can vouch for follows the slope of the last rows: an
    exponential tail.

    Raises ProblemError for a damaged table.
    """
    table = info.get("noise_quantiles")
    if table is None:
        return default_quantile(risk)
    try:
        depth = -np.log(np.array(table["risks"], dtype=float))
        values = np.array(table["quantiles"], dtype=float)
        is_table = (
            depth.shape == values.shape
            and len(depth) >= 2
            and (np.diff(depth) > 0).all()
            and np.isfinite(values).all()
        )
    except (TypeError, KeyError, ValueError):
        is_table = False
    if not is_table:
        raise ProblemError("the model's table noise_quantiles is damaged: calibrate it anew")
    wanted = -np.log(risk)
    if wanted <= depth[-1]:
        return float(np.interp(wanted, depth, values))
    first = max(0, len(depth) - 4)
    slope = (values[-1] - values[first]) / (depth[-1] - depth[first])
    return float(values[-1] + max(slope, 0.0) * (wanted - depth[-1]))
