"""The command check of a robot that is not round: each of its circles against each obstacle."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.margins.command_check import AT_CENTRE, CommandCheck, CommandShare
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_noise import FeltNoise, ModelNoise
from kmpc_lite.control.options import MarginOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array


class BodyCommandCheck(CommandCheck):
    """Slows a command that could end with one of the robot's circles in an obstacle.

    Parameters
    ----------
    model : MotionModel
        Predicts.
    noise : ModelNoise
        Of that model.
    problem : NavigationProblem
        Radius of the circles.
    footprint : Footprint
        Its own.
    options : MarginOptions
        What is kept, and what is always allowed.
    """

    def __init__(
        self,
        model: MotionModel,
        noise: ModelNoise,
        problem: NavigationProblem,
        footprint: Footprint,
        options: MarginOptions,
    ) -> None:
        super().__init__(model, noise, problem, options)
        self._footprint, self._reach = footprint, footprint.reach

    def speed_share(
        self,
        drift: DriftState,
        here: Array,
        command: Array,
        circles: Array,
        past: Array | None = None,
    ) -> CommandShare:
        """Find the largest share of a command at which no circle of the robot ends in an obstacle.

        As that of a round robot, with obstacles (C, M, 5) for each of the robot's circles: they may
        stand for solids as seen from there. What leads one circle away from an obstacle and another
        into one is not driven.
        """
        if not circles.size:
            return CommandShare(1.0, math.inf)
        places = self._footprint.places(here)
        away = places[:, None] - circles[..., :2]
        before = np.hypot(away[..., 0], away[..., 1])
        clearance = before - circles[..., 2] - (self._touch + self._check_margin)
        nearest = float(clearance.min())
        v, omega = command.tolist()
        felt = self._noise.felt(drift)
        fastest = abs(v) + self._reach * abs(omega)
        far = self._options.check_far_periods * fastest * self._model.dt
        if nearest > far + self._error(felt, v, omega):
            return CommandShare(1.0, nearest)
        along = np.array((math.cos(here[2]), math.sin(here[2])))
        arms = places - here[:2]
        moving = v * along + omega * np.stack([-arms[:, 1], arms[:, 0]], axis=1)
        speeds = np.maximum(np.hypot(*moving.T), AT_CENTRE)[:, None]
        leaving = (away * moving[:, None]).sum(axis=-1) / speeds
        share = 1.0
        for _ in range(self._options.check_corrections):
            approach = self._approaches(felt, here, share * command, circles, past, places)
            closing = approach > clearance
            if not closing.any():
                break
            possible = self.sure(clearance) / np.maximum(approach, AT_CENTRE)
            limits = np.where(closing, possible, 1.0)
            entering = closing & (leaving < 0.0)
            if not entering.any():
                allowed = self._retreat(limits, leaving, before, clearance)
                return CommandShare(share * allowed, nearest)
            share *= float(limits[entering].min())
        return CommandShare(share, nearest)

    def _error(self, felt: FeltNoise, v: float, omega: float) -> float:
        """Quantile of a command's error in any direction, turning included [m]."""
        turn = (v * v * felt.command[0, 8] + omega * omega * felt.command[1, 8]) ** 0.5
        aside = self._noise.step_quantile * self._reach * float(turn)
        return super()._error(felt, v, omega) + aside

    def _stop_errors(self, felt: FeltNoise, rates: Array) -> Array:
        """The same with what turning may be wrong by, at the ends of the robot."""
        aside = self._added_up(rates, felt.command[:, 8].tolist(), felt.lasting[:, 8].tolist())
        return super()._stop_errors(felt, rates) + self._reach * aside

    def _approaches(
        self,
        felt: FeltNoise,
        here: Array,
        command: Array,
        circles: Array,
        past: Array | None,
        places: Array,
    ) -> Array:
        """How much nearer each circle may come to each obstacle, errors included, (C, M) [m]."""
        there = self._model.predict(here, command, past)
        ends = self._footprint.places(there)
        away = places[:, None] - circles[..., :2]
        before = np.hypot(away[..., 0], away[..., 1])
        after = np.hypot(*(ends[:, None] - circles[..., :2]).transpose(2, 0, 1))
        approach = before - after
        if felt.command_errs:
            cos, sin = np.cos(here[2]), np.sin(here[2])
            noise = ((command * command) @ felt.command).reshape(3, 3)
            x, y = self._footprint.circles.T[..., None]
            ahead, left = away @ (cos, sin), away @ (-sin, cos)
            slopes = np.stack([ahead, left, left * x - ahead * y], axis=-1)
            variance = ((slopes @ noise) * slopes).sum(axis=-1)
            deviation = self._noise.step_quantile * np.sqrt(np.maximum(variance, 0.0))
            approach += deviation / np.maximum(before, AT_CENTRE)
        # a circle on an arc comes nearer between its ends by what chord and bulge cut off
        chords = np.hypot(*(ends - places).T)
        bulges = chords * abs(float(there[2] - here[2])) / 8.0
        centres = np.maximum(before, self._touch)
        approach += np.sqrt(centres**2 + 0.25 * chords[:, None] ** 2) - centres + bulges[:, None]
        out: Array = approach
        return out
