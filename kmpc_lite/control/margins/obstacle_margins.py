"""The margin of every obstacle at every stage of a plan.

Zero-order robust optimisation (Zanelli et al. 2021, zoRO in acados): the spread of the robot around
its plan is computed at the last iterate and stays outside the QP, which gets no new variables, only
half-planes that are farther away.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.kernels import NUMPY, Kernels, tube
from kmpc_lite.control.margins.model_noise import SOLVER_MARGIN, FeltNoise, ModelNoise, factor
from kmpc_lite.control.options import MarginOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.model.tube import MEMORY, TURN
from kmpc_lite.types import STATES, Array

NOTHING = np.empty((STATES, 0))
"""Factors of a noise that there is none of."""

FAR_CLEARANCE = 2 / 3
"""Margins are worked out for obstacles within the widest margin and this much more [radii]; for
those farther away the widest margin is used."""


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
    kernels : Kernels
        Compute them.

    Attributes
    ----------
    side_margin, far_clearance : float
        As in the options [m].
    pose_deviation : float
        Standard deviation of a measured position, at full speed [m].
    """

    def __init__(
        self,
        noise: ModelNoise,
        problem: NavigationProblem,
        options: MarginOptions,
        kernels: Kernels = NUMPY,
    ) -> None:
        footprint = problem.footprint
        self._reach = 0.0 if footprint is None else footprint.reach
        """How far what is kept off obstacles lies from the pose: turning moves it [m]."""
        self._noise, self._kernels = noise, kernels
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
        felt = noise.felt(InnovationState())
        self._pose = factor(noise.tube.pose)
        by_speed = noise.tube.pose_by_speed
        self._pose_by_speed = factor(by_speed) if by_speed.any() else NOTHING
        self._widest_for, self._widest = felt, self._work_out_widest(felt)
        self._tube_for, self._tube = felt, self._tube_of(felt)

    def margins(
        self,
        drift: InnovationState,
        lin: Linearization,
        states: Array,
        inputs: Array,
        normals: Array,
        path_clearance: float | Array = math.inf,
    ) -> Array:
        """Distances that stages 1 to N must keep beyond the radii.

        Parameters
        ----------
        drift : InnovationState
            What past innovations say of the noise.
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
        noise = self.noise_of(drift)
        return self._kernels.tube_margins(noise, lin.A, states, speeds(inputs), normals, kept)

    def covariances(
        self, drift: InnovationState, lin: Linearization, states: Array, inputs: Array
    ) -> Array:
        """Covariances (N, 2, 2) of the position at stages 1 to N [m^2]; see `margins`."""
        factors = tube.factors(self.noise_of(drift), lin.A, states, speeds(inputs))[:, :2]
        out: Array = factors @ factors.transpose(0, 2, 1)
        return out

    def noise_of(self, drift: InnovationState) -> tube.Noise:
        """What the margins of plans follow from, as past innovations say."""
        felt = self._noise.felt(drift)
        if felt is not self._tube_for:
            self._tube_for, self._tube = felt, self._tube_of(felt)
        return self._tube

    def _tube_of(self, felt: FeltNoise) -> tube.Noise:
        return tube.Noise(
            white=felt.plan_factor,
            lasting=NOTHING if felt.lasting_factor is None else felt.lasting_factor,
            pose=self._pose,
            pose_by_speed=self._pose_by_speed,
            delay=self._noise.delay,
            quantile=self._noise.quantile,
            headway_time=self._headway,
            touch=self._touch,
            reach=self._reach,
            solver_margin=self._solver_margin,
            spreads=felt.plan_spreads,
        )

    def widest(self, drift: InnovationState) -> float:
        """Margin that no plan within the command bounds exceeds [m]."""
        felt = self._noise.felt(drift)
        if felt is not self._widest_for:
            self._widest_for, self._widest = felt, self._work_out_widest(felt)
        return self._widest

    def _work_out_widest(self, felt: FeltNoise) -> float:
        """Add up all noise at full speed, taken back by nothing but time."""
        v, omega = self._fastest
        noise = self._noise
        travel, periods = v * noise.dt, MEMORY + noise.delay
        squares, whole = self._heading_periods
        by_speed, by_turn_rate = felt.plan_trace
        turned = felt.plan.item(0, 8) * v * v + felt.plan.item(1, 8) * omega * omega
        turn_variance = periods * turned + self._heading_variance
        variance = (
            periods * (v * v * by_speed + omega * omega * by_turn_rate)
            + travel * travel * turned * squares
            + self._pose_variance
        )
        if felt.lasting_factor is not None:
            by_speed, by_turn_rate = felt.lasting_trace
            turned = felt.lasting.item(0, 8) * v * v + felt.lasting.item(1, 8) * omega * omega
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
