"""Margins of plans and motions: what is kept beyond the radii for what the model does not know.

Those of a plan: zero-order robust optimisation (Zanelli et al. 2021, zoRO in acados). The spread of
the robot around its plan is computed at the last iterate and stays outside the QP, which gets no
new variables, only half-planes that are farther away. Those of motions that are about to be driven
take commands as they will be sent; errors grow with the speed, so that a slower robot may come
nearer to an obstacle.

The noise of one period grows with its command, ``v^2 white[0] + omega^2 white[1]``, and so do the
errors that last longer than a plan. Innovations inflate both; quantiles turn them into
distances. A (2, 9) array holds two such covariances (3, 3), in the robot's frame.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.control.estimate.innovation import ExpectedErrors, InnovationState
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.records import Noise
from kmpc_lite.control.options import MarginOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import FLOOR, MEMORY, TURN, feedback_delay, tube_noise
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
ADDS_UP = 9.0  # periods for which an error that lasts adds up until measured poses have told it
HEADING = 8  # place of the heading's variance in a covariance (9,)
UNKNOWN_FLOOR_SLIP = 0.35
"""Standard deviation of a command's error on an unknown floor, as a share of what it drives: a slip
of 0.2 pushes farther than five times that once in ten thousand periods."""
FAR_CLEARANCE = 2 / 3
"""Margins are worked out for obstacles within the widest margin and this much more [radii]; for
those farther away the widest margin is used."""


class InflatedNoise(NamedTuple):
    """Covariances (2, 9) of a period, by v^2 and by omega^2."""

    plan: Array  # of the later periods of a plan
    lasting: Array  # of errors common to all periods of a plan, in a single one
    command: Array  # of the coming period: larger on an unknown floor
    spreads: bool  # whether there is any noise in a plan


class FeltNoise(NamedTuple):
    """The noise of a model as inflated by past innovations; worked out once a step."""

    tube: Noise  # of the later periods of a plan, as its margins follow from it
    widest: float  # margin that no plan within the command bounds exceeds [m]
    command: Array
    """(2, 9) covariances (3, 3) of the coming period, to be multiplied by v^2 and by omega^2, in
    the robot's frame: larger on an unknown floor."""
    position_errors: Array
    """(4,) variances of the coming period by v^2 and by omega^2, then what lasts of them: of the
    position, in all directions together [m^2] ..."""
    heading_errors: Array  # ... and of the heading [rad^2], as `kernels.stop_errors` takes them.
    command_errs: bool  # whether there is any noise in the coming period
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


class Margins:
    """Margins of plans and of motions, and what innovations are expected, for one model.

    It remembers nothing of a drive: the noise as past innovations inflate it (`felt`) is the first
    argument of all that depends on them. Another model gets other `Margins`.

    `model`: its noise model and its table of quantiles; without these only speed and chords count.
    `problem`: horizon, period, outline, margin and command bounds. `options`: risks, headway, and
    what is added to every margin. `adapted`: whether the model was corrected while driving: it
    knows its floor from a few seconds, so that single commands are made safe for rarer errors.
    Raises ProblemError for a damaged table of quantiles in the model.

    Attributes: `noise`: noise and quantiles. `expected_errors`: tells whether the robot does
    otherwise than its model says. `side_margin`, `far_clearance`: from the sides of the area, and
    beyond which obstacles are far [m]. `pose_deviation`: standard deviation of a measured position,
    at full speed [m]. `calm`: as long as innovations are what the model expects.
    """

    def __init__(
        self,
        model: MotionModel,
        problem: NavigationProblem,
        options: MarginOptions | None = None,
        *,
        adapted: bool = False,
    ) -> None:
        options = MarginOptions() if options is None else options
        self.noise = noise = ModelNoise(model, problem, options, adapted)
        self.expected_errors = noise.expected_errors
        self._model, self._horizon = model, problem.horizon
        self._directions = 2 if problem.footprint is None else 3
        unit = unit_length(problem)
        self._solver_margin = SOLVER_MARGIN * unit
        self.side_margin = options.side_margin * unit
        self.far_clearance = FAR_CLEARANCE * unit
        self._touch = float(problem.body_radius + problem.margin)
        speed = fastest(problem)[0]
        self._headway = options.headway * unit / speed
        """Time of driving on at a speed that is the least margin [s]."""
        headway = self._headway * float(speed)
        self._widest = Widest(noise, problem, headway, self._solver_margin)
        self._reach = self._widest.reach
        self.pose_deviation = math.sqrt(max(0.5 * self._widest.pose_variance, 0.0))
        self._pose_error = self._pose_error_of(noise.tube.pose_deviation[0] ** 2)
        self.calm = self._felt(1.0, False)

    def felt(self, state: InnovationState) -> FeltNoise:
        """Work out the noise as past innovations inflate it."""
        errors = self.noise.expected_errors
        inflation, unknown = errors.inflation(state), errors.is_unknown_floor(state)
        felt = self._felt(inflation, unknown) if unknown or inflation != 1.0 else self.calm
        if state.estimate is None:
            return felt
        pose = state.estimate.covariance
        tube = felt.tube._replace(pose=pose, pose_by_speed=np.zeros_like(pose))
        error = self._pose_error_of(0.5 * float(pose[0, 0] + pose[1, 1]))
        return felt._replace(tube=tube, pose_error=error)

    def _pose_error_of(self, variance: float) -> float:
        return self.noise.quantile * math.sqrt(max(variance - FLOOR**2, 0.0))

    def _felt(self, inflation: float, unknown_floor: bool) -> FeltNoise:
        noise, found = self.noise, self.noise.inflated(inflation, unknown_floor)
        command, lasting = found.command, found.lasting
        return FeltNoise(
            tube=Noise(
                white=found.plan,
                lasting=np.sqrt(lasting[:, :: STATES + 1]),
                pose=noise.tube.pose,
                pose_by_speed=noise.tube.pose_by_speed,
                delay=noise.delay,
                quantile=noise.quantile,
                headway_time=self._headway,
                touch=self._touch,
                reach=self._reach,
                solver_margin=self._solver_margin,
                spreads=found.spreads,
            ),
            widest=self._widest.of(found),
            command=command,
            position_errors=np.concatenate([n[:, 0] + n[:, 4] for n in (command, lasting)]),
            heading_errors=np.concatenate([command[:, HEADING], lasting[:, HEADING]]),
            command_errs=found.spreads or unknown_floor,
            pose_error=self._pose_error,
        )

    def of_plan(
        self,
        felt: FeltNoise,
        lin: Linearization,
        states: Array,
        inputs: Array,
        normals: Array,
        path_clearance: float | Array = math.inf,
    ) -> Array:
        """Distances that stages 1 to N must keep beyond the radii.

        `felt`: the noise, as past innovations inflate it. `lin`: of the model at `states[:-1]` and
        `inputs`. `states`, `inputs`: the plan: (N + 1, 3) and (N, 2). `normals`: unit vectors away
        from the obstacles, (N, S, 2); of a robot with a footprint (N, S, 3): slopes of its
        clearances by x, y and heading. `path_clearance`: what the path keeps from obstacles beyond
        the problem's margin [m], or at each stage, (N, 1): headway is no more than that, or the
        robot would not drive through narrow passages. Returns (N, S) [m].
        """
        kept = np.broadcast_to(np.ravel(path_clearance), len(inputs))
        return library.tube_margins(felt.tube, lin.A, states, speeds(inputs), normals, kept)

    def of_motions(self, felt: FeltNoise, distances: Array, turns: Array) -> Array:
        """Margins (..., T) at the end of each period [m].

        `felt`: the noise, as past innovations inflate it. `distances`, `turns`: what is driven [m]
        and turned [rad] in each period, (..., T).
        """
        noise = self.noise
        if not felt.command_errs:
            return np.full(distances.shape, self._solver_margin)
        errors = library.stop_errors(
            distances,
            turns,
            noise.dt,
            felt.position_errors,
            felt.heading_errors,
            noise.step_quantile,
            noise.quantile,
            self._reach,
        )
        errors += self._solver_margin
        return errors

    def of_commands(self, felt: FeltNoise, commands: Array, slopes: Array) -> Array:
        """Errors (C, ...) of single commands (C, 2) towards things [m].

        `felt`: the noise, as past innovations inflate it. `commands`: (C, 2) [m/s, rad/s].
        `slopes`: (..., 3) by how much clearances grow with the pose, in the robot's frame.
        """
        commands = speeds(commands)
        noise = ((commands * commands) @ felt.command).reshape(-1, STATES, STATES)
        variance = np.einsum("...i,cij,...j->c...", slopes, noise, slopes)
        out: Array = self.noise.step_quantile * np.sqrt(np.maximum(variance, 0.0))
        return out

    def most_of_commands(self, felt: FeltNoise, commands: Array) -> Array:
        """Errors (C,) of single commands (C, 2) in any direction, at the most [m]."""
        if not felt.command_errs:
            return np.zeros(len(commands))
        squares = speeds(commands) ** 2
        errors = np.sqrt(squares @ felt.position_errors[:2])
        if self._reach:
            errors += self._reach * np.sqrt(squares @ felt.heading_errors[:2])
        out: Array = self.noise.step_quantile * errors
        return out

    def straight(self, speed: float) -> tuple[float, float]:
        """Margins ahead and aside [m] of the last stage of a straight drive, without headway.

        `speed`: [m/s], held for long before.
        """
        model, stages = self._model, self._horizon
        command = np.zeros(model.inputs)
        command[0] = speed
        inputs = np.tile(command, (stages, 1))
        states = np.zeros((stages + 1, 3))
        states[:, 0] = speed * model.dt * np.arange(stages + 1)
        past = np.tile(command, (stages, model.history, 1))
        lin = model.linearize(states[:-1], inputs, past)
        normals = np.tile(np.eye(2, self._directions), (stages, 1, 1))
        found = self.of_plan(self.calm, lin, states, inputs, normals, path_clearance=0.0)
        return float(found[-1, 0]), float(found[-1, 1])


class Widest:
    """Adds up all that a margin consists of.

    `noise`: of the model. `problem`: outline and command bounds. `headway`, `solver_margin`: least
    margin at the fastest speed, and what is added to every margin [m].
    """

    def __init__(
        self, noise: ModelNoise, problem: NavigationProblem, headway: float, solver_margin: float
    ) -> None:
        self._noise, self._headway, self._solver_margin = noise, headway, solver_margin
        self.reach = 0.0 if problem.footprint is None else problem.footprint.reach
        """How far what is kept off obstacles lies from the pose: turning moves it [m]."""
        v, omega = fastest(problem)
        self._squares = np.array((v * v, omega * omega))
        pose = noise.tube.pose + v**2 * noise.tube.pose_by_speed
        self.pose_variance = float(pose[0, 0] + pose[1, 1])
        """Of a measured position, at full speed, both axes together [m^2]."""
        self._heading_variance = float(pose[2, 2])
        # how often each error counts, as it is and as it leads aside; then those that last
        aside = [min(k, noise.delay + 1.0 / TURN) for k in range(1, MEMORY + noise.delay + 1)]
        periods, driven = len(aside), (v * noise.dt) ** 2
        once = periods, driven * sum(a * a for a in aside)
        self._counts = once, (periods**2, driven * sum(aside) ** 2)
        # what a period at full speed, driving and turning, cuts off
        radius, dt = float(problem.body_radius), noise.dt
        travel = v * dt + self.reach * omega * dt
        self._chord = math.hypot(radius + travel * omega * dt / 8, travel / 2) - radius

    def of(self, found: InflatedNoise) -> float:
        """Add up all noise at full speed, taken back by nothing but time."""
        variance, turn_variance = self.pose_variance, self._heading_variance
        for errors, (periods, aside) in zip((found.plan, found.lasting), self._counts, strict=True):
            x, _, _, _, y, _, _, _, turned = (self._squares @ errors).tolist()
            variance += periods * (x + y) + aside * turned
            turn_variance += periods * turned
        deviation = math.sqrt(variance)
        if self.reach:
            deviation += self.reach * math.sqrt(turn_variance)
        widest = max(self._noise.quantile * deviation, self._headway)
        return widest + self._chord + self._solver_margin
