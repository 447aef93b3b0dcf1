"""The margin of every obstacle at every stage of a plan.

Zero-order robust optimisation (Zanelli et al. 2021, zoRO in acados): the spread of the robot around
its plan is computed at the last iterate and stays outside the QP, which gets no new variables, only
half-planes that are farther away.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.kernels import tube
from kmpc_lite.control.margins.model_noise import (
    SOLVER_MARGIN,
    InflatedNoise,
    ModelNoise,
    factor,
    factors,
    trace,
)
from kmpc_lite.control.options import MarginOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.model.tube import MEMORY, TURN
from kmpc_lite.types import STATES, Array

HEADING = 8
"""Place of the heading's variance in a covariance (9,)."""
NOTHING = np.empty((STATES, 0))
"""Factors of a noise that there is none of."""

FAR_CLEARANCE = 2 / 3
"""Margins are worked out for obstacles within the widest margin and this much more [radii]; for
those farther away the widest margin is used."""


class FeltNoise(NamedTuple):
    """The noise of a model as inflated by past innovations; worked out once a step."""

    tube: tube.Noise
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


class Tightening:
    """Margins of a plan: from the model's noise, from its speed, and between its samples.

    Parameters
    ----------
    noise : ModelNoise
        Spreads the tube; for a model without noise only speed and chords count.
    problem : NavigationProblem
        Robot radius, margin and command bounds.
    options : MarginOptions
        Headway, and what is added to every margin.

    Attributes
    ----------
    side_margin, far_clearance : float
        As in the options [m].
    pose_deviation : float
        Standard deviation of a measured position, at full speed [m].
    calm : FeltNoise
        As long as innovations are what the model expects.
    """

    def __init__(
        self,
        noise: ModelNoise,
        problem: NavigationProblem,
        options: MarginOptions,
    ) -> None:
        footprint = problem.footprint
        self._reach = 0.0 if footprint is None else footprint.reach
        """How far what is kept off obstacles lies from the pose: turning moves it [m]."""
        self._noise = noise
        unit = unit_length(problem)
        self._solver_margin = SOLVER_MARGIN * unit
        self.side_margin = options.side_margin * unit
        self.far_clearance = FAR_CLEARANCE * unit
        self._robot_radius = float(problem.body_radius)
        self._touch = float(problem.body_radius + problem.margin)
        self._fastest = fastest(problem)
        self._headway = options.headway * unit / self._fastest[0]
        """Time of driving on at a speed that is the least margin [s]."""
        pose = noise.tube.pose + self._fastest[0] ** 2 * noise.tube.pose_by_speed
        self._pose_variance = float(pose[0, 0] + pose[1, 1])
        self._heading_variance = float(pose[2, 2])
        self.pose_deviation = math.sqrt(max(0.5 * self._pose_variance, 0.0))
        self._heading_periods = self._periods_off(noise)
        self._chord_at_full_speed = self._chord(noise.dt)
        self._pose = factor(noise.tube.pose)
        by_speed = noise.tube.pose_by_speed
        self._pose_by_speed = factor(by_speed) if by_speed.any() else NOTHING
        self.calm = self._felt(1.0, False)

    def felt(self, state: InnovationState) -> FeltNoise:
        """Work out the noise as past innovations inflate it."""
        errors = self._noise.expected_errors
        inflation, unknown = errors.inflation(state), errors.is_unknown_floor(state)
        return self._felt(inflation, unknown) if unknown or inflation != 1.0 else self.calm

    def _felt(self, inflation: float, unknown_floor: bool) -> FeltNoise:
        noise, found = self._noise, self._noise.inflated(inflation, unknown_floor)
        command, lasting = found.command, found.lasting
        return FeltNoise(
            tube=tube.Noise(
                white=factors(found.plan),
                lasting=factors(lasting) if noise.lasts else NOTHING,
                pose=self._pose,
                pose_by_speed=self._pose_by_speed,
                delay=noise.delay,
                quantile=noise.quantile,
                headway_time=self._headway,
                touch=self._touch,
                reach=self._reach,
                solver_margin=self._solver_margin,
                spreads=found.spreads,
            ),
            widest=self._widest(found),
            command=command,
            position_errors=np.array(trace(command) + trace(lasting)),
            heading_errors=np.concatenate([command[:, HEADING], lasting[:, HEADING]]),
            command_errs=found.spreads or unknown_floor,
        )

    def margins(
        self,
        felt: FeltNoise,
        lin: Linearization,
        states: Array,
        inputs: Array,
        normals: Array,
        path_clearance: float | Array = math.inf,
    ) -> Array:
        """Distances that stages 1 to N must keep beyond the radii.

        Parameters
        ----------
        felt : FeltNoise
            The noise, as past innovations inflate it.
        lin : Linearization
            Of the model at `states[:-1]` and `inputs`.
        states, inputs : ndarray
            The plan: (N + 1, 3) and (N, 2).
        normals : ndarray
            Unit vectors away from the obstacles, (N, S, 2); of a robot with a footprint (N, S, 3):
            slopes of its clearances by x, y and heading.
        path_clearance : float or ndarray
            What the path keeps from obstacles beyond the problem's margin [m], or at each stage,
            (N, 1): headway is no more than that, or the robot would not drive through narrow
            passages.

        Returns
        -------
        ndarray
            (N, S) [m].
        """
        kept = np.broadcast_to(np.ravel(path_clearance), len(inputs))
        return tube.tube_margins(felt.tube, lin.A, states, speeds(inputs), normals, kept)

    def covariances(
        self, felt: FeltNoise, lin: Linearization, states: Array, inputs: Array
    ) -> Array:
        """Covariances (N, 2, 2) of the position at stages 1 to N [m^2]; see `margins`."""
        factors = tube.factors(felt.tube, lin.A, states, speeds(inputs))[:, :2]
        out: Array = factors @ factors.transpose(0, 2, 1)
        return out

    def _widest(self, found: InflatedNoise) -> float:
        """Add up all noise at full speed, taken back by nothing but time."""
        v, omega = self._fastest
        noise, plan, lasting = self._noise, found.plan, found.lasting
        travel, periods = v * noise.dt, MEMORY + noise.delay
        squares, whole = self._heading_periods
        by_speed, by_turn_rate = trace(plan)
        turned = plan.item(0, HEADING) * v * v + plan.item(1, HEADING) * omega * omega
        turn_variance = periods * turned + self._heading_variance
        variance = (
            periods * (v * v * by_speed + omega * omega * by_turn_rate)
            + travel * travel * turned * squares
            + self._pose_variance
        )
        if noise.lasts:
            by_speed, by_turn_rate = trace(lasting)
            turned = lasting.item(0, HEADING) * v * v + lasting.item(1, HEADING) * omega * omega
            variance += periods**2 * (v * v * by_speed + omega * omega * by_turn_rate)
            variance += travel * travel * turned * whole**2
            turn_variance += periods**2 * turned
        headway = self._headway * float(v)
        deviation = math.sqrt(variance)
        if self._reach:
            deviation += self._reach * math.sqrt(turn_variance)
        widest = max(noise.quantile * deviation, headway)
        return widest + self._chord_at_full_speed + self._solver_margin

    def _periods_off(self, noise: ModelNoise) -> tuple[float, float]:
        """For how many periods each heading error leads aside: sum of the squares, and sum."""
        aside = [min(k, noise.delay + 1.0 / TURN) for k in range(1, MEMORY + noise.delay + 1)]
        return sum(a * a for a in aside), sum(aside)

    def _chord(self, dt: float) -> float:
        """What a period at full speed, driving and turning, cuts off [m]."""
        v, omega = self._fastest
        travel = v * dt + self._reach * omega * dt
        bulge = travel * omega * dt / 8
        return math.hypot(self._robot_radius + bulge, travel / 2) - self._robot_radius
