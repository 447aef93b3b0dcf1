"""A quick check whether a braking ramp is clear, without a rollout: it suffices in most steps.

A ramp that it calls clear is clear; any other ramp may still be. For a robot that lags,
`stop_trajectory` then rolls it out; a robot without lag brakes at once instead.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.kernels.clearance import distances
from kmpc_lite.control.options import StopOptions, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import INPUTS, STATES, Array


class QuickLook:
    """Looks at the braking ramp after the coming command.

    Parameters
    ----------
    problem : NavigationProblem
        Period and robot radius.
    braking : Braking
        The ramp.
    options : StopOptions
        How wrong the check of a robot that lags may be.
    """

    def __init__(self, problem: NavigationProblem, braking: Braking, options: StopOptions) -> None:
        self._dt, self._radius, self._braking = problem.dt, problem.robot_radius, braking
        self._error = options.quick_look_error * unit_length(problem)
        self._error_share = options.quick_look_error_share
        self._counts = np.arange(1.0, braking.longest_ramp + 1)
        self._response_of: MotionModel | None = None
        self._response = np.empty((3, 0))

    def ramp_is_clear(self, states: Array, periods: float, things: Array, margin: float) -> bool:
        """Whether the ramp of a robot without lag keeps a margin.

        It is the arc of the coming period, driven on ever more slowly.

        Parameters
        ----------
        states : ndarray
            The plan (N + 1, 3), whose first period is the coming one.
        periods : float
            Of the ramp, as a fraction.
        things : ndarray
            (M, 7) at the end of the coming period.
        margin : float
            [m].
        """
        (x0, y0, before), (x1, y1, after) = states[:2].tolist()
        k = self._counts[: min(math.ceil(periods), len(self._counts))]
        # how often the coming period's arc is driven again up to each stage: 1 - 1/periods, ...
        times = k * (1.0 - (k + 1.0) / (2.0 * max(periods, 1.0)))
        turned = 0.5 * (after - before) * (1.0 + times)
        cos, sin = times * np.cos(turned), times * np.sin(turned)
        dx, dy = x1 - x0, y1 - y0
        x, y = x1 + dx * cos - dy * sin, y1 + dx * sin + dy * cos
        return self._least_clearance(x, y, self._dt * k, things) >= margin

    def lagging_ramp_is_clear(
        self,
        model: MotionModel,
        states: Array,
        command: Array,
        past: Array,
        things: Array,
        margin: float,
    ) -> bool:
        """Whether the ramp of a robot that lags, and the coasting after it, keep a margin.

        The model's response to commands is summed up at once: a tenth of the time of a rollout.

        Parameters
        ----------
        model : MotionModel
            With input history.
        states : ndarray
            The plan (N + 1, 3).
        command, past : ndarray
            The coming command (2,), and those already sent (L, 2).
        things : ndarray
            (M, 7) at the end of the coming period.
        margin : float
            [m].
        """
        if model is not self._response_of:
            self._response_of, self._response = model, _response(model)
        ramp, coasting = self._braking.ramp(command), np.zeros((model.history, INPUTS))
        commands = np.concatenate([past, command[None], ramp, coasting])
        first, count = model.history, len(commands) - model.history
        speeds, turn_rates = (np.ascontiguousarray(column) for column in commands.T)
        ahead, aside, turned = (
            np.convolve(given, response)[first : first + count]
            for given, response in zip((speeds, speeds, turn_rates), self._response, strict=True)
        )
        x0, y0, heading = states[0].tolist()
        headings = heading + np.cumsum(turned) - 0.5 * turned
        cos, sin = np.cos(headings), np.sin(headings)
        x = x0 + np.cumsum(ahead * cos - aside * sin)
        y = y0 + np.cumsum(ahead * sin + aside * cos)
        error = self._error + self._error_share * float(np.abs(ahead).sum())
        least = self._least_clearance(x, y, self._dt * np.arange(count), things)
        # also false for NaN
        return least >= margin + error

    def _least_clearance(self, x: Array, y: Array, times: Array, things: Array) -> float:
        """Clearance at places (T,) [m], at times (T,) after the coming period [s]."""
        nearest = distances(things, np.stack([x, y], axis=1), times)
        return float(nearest.min(initial=np.inf)) - self._radius


def _response(model: MotionModel) -> Array:
    """Motion by the age of a command, (3, L + 1): ahead and aside by v, turned by omega."""
    lin = model.linearize(np.zeros(STATES), np.zeros(INPUTS))
    by_age = np.concatenate([lin.B[None], lin.B_past])
    return np.stack([by_age[:, 0, 0], by_age[:, 1, 0], by_age[:, 2, 1]])
