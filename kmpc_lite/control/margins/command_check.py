"""The command that is about to be sent: at what share of its speeds the coming period is safe.

Margins of a plan are computed for the trajectory that its QP is linearised at; the command check
takes the command as it will be sent. The noise grows with the speed, so that a slower robot may
come nearer to an obstacle.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.margins.chords import halves, least_on_way
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_noise import FeltNoise, ModelNoise
from kmpc_lite.control.options import MarginOptions, fastest, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.model.tube import FLOOR
from kmpc_lite.types import Array

AT_CENTRE = 1e-9
"""Distance below which a direction cannot be told [m]."""


class CommandShare(NamedTuple):
    """What the command check found."""

    share: float
    """Share from 0 to 1 by which both speeds are to be multiplied, so that the curve is kept."""
    nearest: float
    """Clearance between the robot and the nearest circle before the command [m]."""


class CommandCheck:
    """Slows a command that an error as rare as the step risk could end in an obstacle.

    Parameters
    ----------
    model : MotionModel
        Predicts.
    noise : ModelNoise
        Of that model.
    problem : NavigationProblem
        Robot radius.
    options : MarginOptions
        What is kept, and what is always allowed.

    Attributes
    ----------
    pose_error : float
        Quantile of how far a measured pose is off [m]: only what a clearance has beyond it is sure.
        Near an obstacle every step may use up a share of its clearance; with one that is not sure,
        many steps would end in the obstacle.
    """

    def __init__(
        self,
        model: MotionModel,
        noise: ModelNoise,
        problem: NavigationProblem,
        options: MarginOptions,
    ) -> None:
        self._model, self._noise, self._options = model, noise, options
        unit = unit_length(problem)
        self._solver_margin, self._check_margin = (
            options.solver_margin * unit,
            options.check_margin * unit,
        )
        # a retreat may graze what it leads past, by less than the margin of this check: the sine of
        # the angle at which it does
        way = options.retreat_share * (fastest(problem)[0] or 1.0) * model.dt
        self._graze = self._check_margin / way if way else 1.0
        self._touch = problem.body_radius
        variance = noise.tube.pose_deviation[0] ** 2 - FLOOR**2
        self.pose_error = noise.quantile * math.sqrt(max(variance, 0.0))

    def sure(self, clearances: Array) -> Array:
        """What is sure of measured clearances, whatever the pose's noise pretends [m]."""
        out: Array = np.maximum(clearances - self.pose_error, 0.0)
        return out

    def step_margin(self, drift: DriftState, v: float, omega: float) -> float:
        """Distance that a command may end away from where the model says, in any direction [m].

        Parameters
        ----------
        drift : DriftState
            Of the drift detector.
        v, omega : float
            The command [m/s, rad/s].
        """
        return self._solver_margin + self._error(self._noise.felt(drift), v, omega)

    def stop_margins(self, drift: DriftState, distances: Array, turns: Array) -> Array:
        """Distances that a robot may be away from where the model says, at each stage of a stop.

        Errors of single periods add up by their squares, and are as rare as the step risk; those
        that last add up as they are, with the risk of a plan: they are there all the time.

        Parameters
        ----------
        drift : DriftState
            Of the drift detector.
        distances, turns : ndarray
            What it drives [m] and turns [rad] in each period, (..., T).

        Returns
        -------
        ndarray
            (..., T) [m].
        """
        rates = np.abs(np.stack([distances, turns])) / self._model.dt
        return self._solver_margin + self._stop_errors(self._noise.felt(drift), rates)

    def _stop_errors(self, felt: FeltNoise, rates: Array) -> Array:
        """Quantile of the errors in any direction [m] of speeds and turn rates (2, ..., T)."""
        own = self._added_up(rates, felt.command_trace, felt.lasting_trace)
        errors: Array = np.hypot(own, self._led_aside(felt, rates))
        return errors

    def _led_aside(self, felt: FeltNoise, rates: Array) -> Array:
        """Quantile of what headings that are off lead aside [m], over all that is driven after."""
        driven = rates[0] * self._model.dt
        ends = np.cumsum(driven, axis=-1)
        begins, squared = ends - driven, np.zeros_like(ends)
        whole, lasting = felt.command[:, 8].tolist(), felt.lasting[:, 8].tolist()
        for rate, each, lasts in zip(rates, whole, lasting, strict=True):
            white = self._noise.step_quantile**2 * max(each - lasts, 0.0) * rate * rate
            # the sum of what comes from each period, by the squared way from its begin on
            sums = (np.cumsum(white * begins**n, axis=-1) for n in range(3))
            constant, linear, square = sums
            squared += ends * (ends * constant - 2.0 * linear) + square
            if lasts:
                way = ends * np.cumsum(rate, axis=-1) - np.cumsum(rate * begins, axis=-1)
                squared += self._noise.quantile**2 * lasts * way * way
        aside: Array = np.sqrt(np.maximum(squared, 0.0))
        return aside

    def _added_up(self, rates: Array, whole: Sequence[float], lasting: Sequence[float]) -> Array:
        """Quantile of what a variance, by v^2 and by omega^2, adds up to at each stage (..., T)."""
        rare, usual = self._noise.step_quantile, self._noise.quantile
        single, summed = np.zeros(rates.shape[1:]), np.zeros(rates.shape[1:])
        for rate, each, lasts in zip(rates, whole, lasting, strict=True):
            squares, white = rate * rate, max(each - lasts, 0.0)
            single += rare**2 * each * squares
            summed += rare**2 * white * np.cumsum(squares, axis=-1)
            summed += usual**2 * lasts * np.cumsum(rate, axis=-1) ** 2
        worst = np.maximum.accumulate(single, axis=-1)
        errors: Array = np.sqrt(np.maximum(worst, summed))
        return errors

    def speed_share(
        self,
        drift: DriftState,
        here: Array,
        command: Array,
        circles: Array,
        past: Array | None = None,
    ) -> CommandShare:
        """Find the largest share of a command at which the coming period ends in no obstacle.

        Parameters
        ----------
        drift : DriftState
            Of the drift detector.
        here, command : ndarray
            Present pose (3,) and the command (2,).
        circles : ndarray
            (M, 5) as they will be at the end of the period; only x, y and radius are used.
        past : ndarray, optional
            Commands already sent (L, 2), for a model with input history: what those still do cannot
            be taken back here.

        Returns
        -------
        CommandShare
            A robot that already touches may move away from what it touches.
        """
        if not len(circles):
            return CommandShare(1.0, math.inf)
        away = here[:2] - circles[:, :2]
        before = np.hypot(away[:, 0], away[:, 1])
        clearance = before - circles[:, 2] - (self._touch + self._check_margin)
        nearest = float(np.minimum.reduce(clearance))
        v, omega = command.tolist()
        felt = self._noise.felt(drift)
        # far from everything, which is most of the time, there is nothing to weigh up
        far = self._options.check_far_periods * abs(v) * self._model.dt
        if nearest > far + self._error(felt, v, omega):
            return CommandShare(1.0, nearest)
        leaving = math.copysign(1.0, v) * (away @ (math.cos(here[2]), math.sin(here[2])))
        into = -leaving > self._graze * before
        share = 1.0
        for _ in range(self._options.check_corrections):
            approach = self._approach(felt, here, share * command, circles, past, away, before)
            closing = approach > clearance
            if not closing.any():
                break
            possible = self.sure(clearance) / np.maximum(approach, AT_CENTRE)
            limits = np.where(closing, possible, 1.0)
            entering = closing & into
            if not entering.any():
                # a robot at the very centre can only go away
                allowed = self._retreat(limits, leaving, before, clearance)
                return CommandShare(share * allowed, nearest)
            # again, for a curve that is driven slowly turns less in the period than the share says
            share *= float(limits[entering].min())
        return CommandShare(share, nearest)

    def turn_share(self, drift: DriftState, clearance: float, omega: float) -> float:
        """Share of a turn on the spot whose error a clearance [m] allows for.

        Like a retreat, a part of it is always allowed: a robot that touches must get free.
        """
        error = self._error(self._noise.felt(drift), 0.0, omega)
        if error <= max(clearance, 0.0):
            return 1.0
        return max(clearance / error, self._options.retreat_share)

    def _retreat(self, limits: Array, leaving: Array, distance: Array, clearance: Array) -> float:
        """Share that is always allowed of a command which leads away from what is in its way.

        What leads past it has less, for floors push robots aside; but a robot that touches for
        sure, whatever the pose's noise pretends, must get free.

        Parameters
        ----------
        limits : ndarray
            Shares that obstacles allow, of any shape; the least one counts.
        leaving : ndarray
            Part of the distance [m] that lies in the direction of the command.
        distance, clearance : ndarray
            Of each obstacle's middle and of its edge [m].
        """
        worst, least = int(limits.argmin()), self._options.retreat_share
        if clearance.item(worst) > -self.pose_error:
            least *= leaving.item(worst) / max(distance.item(worst), AT_CENTRE)
        return float(max(limits.item(worst), least))

    def _error(self, felt: FeltNoise, v: float, omega: float) -> float:
        """Quantile of a command's error in any direction [m]."""
        by_speed, by_turn_rate = felt.command_trace
        variance = v * v * by_speed + omega * omega * by_turn_rate
        return self._noise.step_quantile * math.sqrt(max(variance, 0.0))

    def _approach(
        self,
        felt: FeltNoise,
        here: Array,
        command: Array,
        circles: Array,
        past: Array | None,
        away: Array,
        before: Array,
    ) -> Array:
        """How much nearer a command may come to each circle, errors included, (M,) [m]."""
        there = self._model.predict(here, command, past)
        first, second, aside = halves(there - here)
        least = np.minimum(least_on_way(away, first), least_on_way(away + first, second))
        approach = before - least
        if felt.command_errs:
            cos, sin = np.cos(here[2]), np.sin(here[2])
            noise = ((command * command) @ felt.command).reshape(3, 3)
            ahead, left = away @ (cos, sin), away @ (-sin, cos)
            variance = (
                ahead * ahead * noise[0, 0]
                + 2.0 * ahead * left * noise[0, 1]
                + left * left * noise[1, 1]
            )
            deviation = self._noise.step_quantile * np.sqrt(np.maximum(variance, 0.0))
            approach += deviation / np.maximum(before, AT_CENTRE)
        approach += aside
        out: Array = approach
        return out


def command_check(
    model: MotionModel, noise: ModelNoise, problem: NavigationProblem, options: MarginOptions
) -> CommandCheck:
    """Give the command check of a problem's robot; arguments as of `CommandCheck`."""
    if problem.footprint is None:
        return CommandCheck(model, noise, problem, options)
    # here, since most robots are round
    from kmpc_lite.control.margins.body_check import BodyCommandCheck

    return BodyCommandCheck(model, noise, problem, problem.footprint, options)
