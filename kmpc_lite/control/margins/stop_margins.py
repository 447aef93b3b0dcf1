"""Margins of motions that are about to be driven: how far they may lead beside what is predicted.

Margins of a plan are computed for the trajectory that its QP is linearised at; these take commands
as they will be sent. Errors grow with the speed, so that a slower robot may come nearer to an
obstacle.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.kernels import NUMPY, Kernels
from kmpc_lite.control.margins.model_noise import SOLVER_MARGIN, ModelNoise
from kmpc_lite.control.margins.obstacle_margins import FeltNoise
from kmpc_lite.control.options import unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.tube import FLOOR
from kmpc_lite.types import STATES, Array


class StopMargins:
    """Quantiles of a model's error over what is driven and turned.

    Parameters
    ----------
    noise : ModelNoise
        Of the model.
    problem : NavigationProblem
        Robot radius or footprint.
    kernels : Kernels
        Compute them.

    Attributes
    ----------
    pose_error : float
        Quantile of how far a measured pose is off [m]: only what a clearance has beyond it is sure.
        Near an obstacle every step may use up a share of its clearance; with one that is not sure,
        many steps would end in the obstacle.
    """

    def __init__(
        self,
        noise: ModelNoise,
        problem: NavigationProblem,
        kernels: Kernels = NUMPY,
    ) -> None:
        self._noise, self._solver_margin = noise, SOLVER_MARGIN * unit_length(problem)
        self._kernels = kernels
        self._reach = 0.0 if problem.footprint is None else problem.footprint.reach
        variance = noise.tube.pose_deviation[0] ** 2 - FLOOR**2
        self.pose_error = noise.quantile * math.sqrt(max(variance, 0.0))

    def of_motions(self, felt: FeltNoise, distances: Array, turns: Array) -> Array:
        """Margins (..., T) at the end of each period [m].

        Parameters
        ----------
        felt : FeltNoise
            The noise, as past innovations inflate it.
        distances, turns : ndarray
            What is driven [m] and turned [rad] in each period, (..., T).
        """
        noise = self._noise
        if not felt.command_errs:
            return np.full(distances.shape, self._solver_margin)
        errors = self._kernels.stop_errors(
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

        Parameters
        ----------
        felt : FeltNoise
            The noise, as past innovations inflate it.
        commands : ndarray
            (C, 2) [m/s, rad/s].
        slopes : ndarray
            (..., 3) by how much clearances grow with the pose, in the robot's frame.
        """
        commands = speeds(commands)
        noise = ((commands * commands) @ felt.command).reshape(-1, STATES, STATES)
        variance = np.einsum("...i,cij,...j->c...", slopes, noise, slopes)
        out: Array = self._noise.step_quantile * np.sqrt(np.maximum(variance, 0.0))
        return out

    def most_of_commands(self, felt: FeltNoise, commands: Array) -> Array:
        """Errors (C,) of single commands (C, 2) in any direction, at the most [m]."""
        if not felt.command_errs:
            return np.zeros(len(commands))
        squares = speeds(commands) ** 2
        errors = np.sqrt(squares @ felt.position_errors[:2])
        if self._reach:
            errors += self._reach * np.sqrt(squares @ felt.heading_errors[:2])
        out: Array = self._noise.step_quantile * errors
        return out

    def sure(self, clearances: Array) -> Array:
        """What is sure of measured clearances, whatever the pose's noise pretends [m]."""
        out: Array = np.maximum(clearances - self.pose_error, 0.0)
        return out
