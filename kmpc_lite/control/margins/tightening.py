"""Room that a plan keeps for what its model does not know: learned residual covariance -> margin per stage and obstacle.

Zero-order robust optimisation (Zanelli et al. 2021, zoRO in acados): the spread of the robot around
its plan is computed at the last iterate and stays outside the QP, which gets no new variables, only
half-planes that are farther away.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from kmpc_lite.control.margins.drift_detector import DriftDetector
from kmpc_lite.control.margins.quantiles import default_quantile, model_quantile
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.koopman import KoopmanModel, Linearization
from kmpc_lite.model.tube import MEMORY, TURN, closed_loop, rotations, split_noise
from kmpc_lite.types import STATES, Array

RISK = 0.05
"""Probability of leaving the tube within its memory (0.8 s at dt = 0.1) that the margins are made
for. A collision is far rarer: the robot would have to leave the tube towards an obstacle that it
touches, and no step in between to correct it."""

LATE_RISK = 0.01
"""The same for a model with input history: its robot does not correct itself within the memory, so
leaving the tube is touching. On 600 maps with lag and noisy poses: no collision, against two, for 2
% more time."""
RESERVE = 0.005
"""Added to every margin [m]: what a QP that is stopped at a tolerance of 1e-3 and linearised once
may leave of a half-plane."""
HEADWAY, LONGEST_HEADWAY = 0.1, 0.06
"""Every plan keeps the way of the first [s] at its speed, at the most the second [m], whatever its
model promises: a floor may begin to slip at any time, and one that slips by 0.2 pushes a robot
aside by half of it in one period of ten. Where the way itself keeps less, the plan does too
(`passage`): more room than there is would only make it shy of narrow passages."""
STEP_RISK, STEP_RISK_CHANGED = 1e-3, 1e-4
"""Probability of the same kind for the single command that is about to be sent: on the floor of the
log, and on one that has changed and is known from a few steps."""

STEP_LIMIT, STEP_LIMIT_CHANGED = 2.0, 3.0
"""What its quantile may be of the plan's: exponential slip asks for 1.9 and 2.6; a log whose pose
jumps, for nonsense."""
STRANGE = 3.0, 0.35
"""Beyond the first inflation a robot does not know its floor: until it does, a command is taken to
err by at least the second, as a share of its way (standard deviation): slip of 0.2 pushes farther
than five times that once in ten thousand periods."""
ROUNDING = 1e-3
"""Room that `speed_share` keeps for its own straight-line reckoning [m]."""
CORRECTIONS = 3
"""How often a command is shortened and looked at again."""
FAR_PERIODS = 3.0
"""What the command covers in so many periods, and the error of one, is far: no model drives three
times as fast as it is told."""
RETREAT = 0.25
"""Share of a command that is always allowed where it leads away from an obstacle: a robot that
touches must get free. One that does not touch is allowed less of it, the more its command leads
past the obstacle and not straight away: aside is where floors push."""


class Tightening:
    """Margins of a plan, from the model's noise and from the chords between samples.

    Parameters
    ----------
    model : KoopmanModel
        Its noise model spreads the tube; without one only the chords count.
    problem : NavigationProblem
        Horizon, period, robot radius and margin.
    risk : float
        See `RISK`.
    quantile : float, optional
        Factor of the standard deviation, as `calibrate` gives it. Where not given it comes from the
        table that `with_quantiles` has left in the model, and without a table from
        `default_quantile`.

    reserve : float
        See `RESERVE` [m].
    headway : float
        See `HEADWAY` [s].

    Raises
    ------
    ProblemError
        For a risk outside (0, 1), a negative quantile, reserve or headway, or a damaged table.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> model, problem = nominal_unicycle(0.1), NavigationProblem()
    >>> inputs = np.tile([0.6, 0.0], (20, 1))
    >>> states = model.rollout((0.0, 0.0, 0.0), inputs)
    >>> tightening = Tightening(model, problem)
    >>> margins = tightening.margins(model.linearize(states[:-1], inputs), states, inputs, np.tile([0.0, 1.0], (20, 4, 1)))
    >>> margins.shape, float(margins[0, 0].round(4))
    ((20, 4), 0.068)
    """

    def __init__(
        self,
        model: KoopmanModel,
        problem: NavigationProblem,
        *,
        risk: float = RISK,
        quantile: float | None = None,
        reserve: float = RESERVE,
        headway: float = HEADWAY,
    ) -> None:
        if isinstance(risk, bool) or not isinstance(risk, int | float) or not 0.0 < risk < 1.0:
            raise ProblemError(f"risk: expected a probability between 0 and 1, got {risk!r}")
        if quantile is not None and not (np.isfinite(quantile) and quantile >= 0.0):
            raise ProblemError(f"quantile: expected a number >= 0, got {quantile!r}")
        if not (np.isfinite(reserve) and reserve >= 0.0):
            raise ProblemError(f"reserve: expected a distance >= 0 m, got {reserve!r}")
        if not (np.isfinite(headway) and headway >= 0.0):
            raise ProblemError(f"headway: expected a time >= 0 s, got {headway!r}")
        self.risk, self._headway = float(risk), float(headway)
        self._given, self._reserve = quantile, float(reserve)
        self._feedback = not model.history
        self._radius = problem.robot_radius + problem.margin
        self._touch = problem.robot_radius
        u_min, u_max, _, _ = problem.bounds
        self._fastest = np.maximum(u_max, -u_min).tolist()
        self.passage = math.inf
        """Room that the way keeps [m], where there is one."""
        self._levels = max(int(MEMORY).bit_length() - 1, 0)
        self._wide = np.empty((0, STATES, 0))
        self._surprise, self.inflation = DriftDetector(model.dt), 1.0
        self.nearest = math.inf
        """Room between the robot and the nearest of the circles that `speed_share` was asked about
        last [m]."""
        self.update(model)

    def reset(self) -> None:
        """Forget what was observed, and the way."""
        self.passage = math.inf
        self._surprise.reset()
        self._inflate(1.0)
        self._doubt()

    def _inflate(self, factor: float) -> None:
        """Scale the noise's standard deviation, and beyond 1 what the model is allowed to be wrong by on top."""
        if factor == self.inflation:
            return
        self.inflation = factor
        self._felt = (
            self._moved
            if factor == 1.0
            else factor**2 * self._moved + (factor**2 - 1.0) * self._surprise.allowed
        )
        self._felt_factor = np.hstack(
            [_factor(part.reshape(STATES, STATES)) for part in self._felt]
        )
        self._felt_trace = (self._felt[:, 0] + self._felt[:, 4]).tolist()
        self.widest = self._widest()
        self._doubt()

    def _doubt(self) -> None:
        """Take a single command to err by more where the floor is not known."""
        strange = self._surprise.drifts or self.inflation > STRANGE[0]
        self._spreads = self._noisy or self.inflation > 1.0
        self._step, self._step_trace, self._errs = (
            self._felt,
            self._felt_trace,
            self._spreads or strange,
        )
        if strange:
            self._step = self._felt.copy()
            self._step[0, [0, 4]] = np.maximum(
                self._felt[0, [0, 4]], (STRANGE[1] * self._model.dt) ** 2
            )
            self._step_trace = (self._step[:, 0] + self._step[:, 4]).tolist()

    def _widest(self) -> float:
        """Margin [m] that no plan within the bounds asks for more than: all noise at full speed, and none of it taken back but by time."""
        v, omega = self._fastest
        travel, turned = (
            v * self._model.dt,
            v * v * float(self._felt[0, 8]) + omega * omega * float(self._felt[1, 8]),
        )
        # by how much a heading error leads aside until it is steered back, or for good
        aside = [min(k, 1.0 / TURN) if self._feedback else k for k in range(1, MEMORY + 1)]
        moved = MEMORY * (v * v * self._felt_trace[0] + omega * omega * self._felt_trace[1])
        variance = (
            moved
            + travel * travel * turned * sum(a * a for a in aside)
            + float(np.trace(self._measured[:2, :2]))
        )
        bulge = travel * omega * self._model.dt / 8
        chord = math.hypot(self._touch + bulge, travel / 2) - self._touch
        return (
            max(self.quantile * math.sqrt(variance), min(self._headway * float(v), LONGEST_HEADWAY))
            + chord
            + self._reserve
        )

    def observe(self, error: Array, heading: float, command: Array) -> None:
        """Compare the past period with what was expected of it; margins widen at once where the model is more wrong than it knows.

        Adaptation needs seconds to tell a new floor from chance. Until then the errors themselves
        say how much room they need.

        Parameters
        ----------
        error : ndarray
            Measured less predicted pose (3,) [m, m, rad], in the map's frame; NaN counts for
            nothing.
        heading : float
            At the beginning of the period [rad].
        command : ndarray
            That was held during it (2,).
        """
        if self._surprise.see(error, heading, command):
            self._doubt()
        self._inflate(self._surprise.inflation)

    def update(self, model: KoopmanModel) -> None:
        """Take over the noise of another model of the same robot, between two steps."""
        self._model = model
        measured, moved = split_noise(model.noise_model)
        self._noisy = model.noise_model is not None
        self._measured, self._moved = measured, np.ascontiguousarray(moved.reshape(2, 9))
        self._measured_factor = _factor(measured)
        # a log that is explained to rounding tells nothing of the tails that a floor may have later
        known = (
            model.info
            if model_quantile(model.info, self.risk) >= default_quantile(self.risk)
            else {}
        )
        self.quantile = (
            model_quantile(known, self.risk) if self._given is None else float(self._given)
        )
        # errors of a model of lag outlast a step: they tell less of floors, and `LATE_RISK` has
        # room for them
        changed = "adaptation" in model.info and not model.history
        risk, limit = (
            (STEP_RISK_CHANGED, STEP_LIMIT_CHANGED) if changed else (STEP_RISK, STEP_LIMIT)
        )
        self._step_quantile = min(
            max(self.quantile, model_quantile(known, risk)), limit * self.quantile
        )
        self._surprise.expect(measured, moved, bool(model.history))
        self.inflation = np.nan  # whatever it was, the noise is another one
        self._inflate(self._surprise.inflation)

    def margins(
        self,
        lin: Linearization,
        states: Array,
        inputs: Array,
        normals: Array,
        radii: Array | None = None,
    ) -> Array:
        """Distances that stages 1 to N must keep beyond the radii.

        Parameters
        ----------
        lin : Linearization
            Of the model at `states[:-1]` and `inputs`.
        states, inputs : ndarray
            The plan: (N + 1, 3) and (N, 2).
        normals : ndarray
            Unit vectors away from the obstacles, (N, S, 2).
        radii : ndarray, optional
            Distance of the robot's centre from each obstacle's centre at touch [m], (S,) or (N, S),
            infinite for a wall. The robot's own radius where not given: the smallest that there is,
            thus safe for all.

        Returns
        -------
        ndarray
            (N, S) [m].
        """
        chords = self._chords(states, radii)
        chords += self._reserve
        if chords.ndim == 1:
            chords = chords[:, None]
        headway = np.abs(inputs[:, :1])
        headway *= self._headway
        np.minimum(headway, min(LONGEST_HEADWAY, self.passage), out=headway)
        if not self._spreads:
            headway = headway + chords
            return (
                np.repeat(headway, normals.shape[1], axis=1) if headway.shape[1] == 1 else headway
            )
        across = normals @ self._spread(lin, states, inputs)
        margins: Array = np.einsum("nsc,nsc->ns", across, across)
        np.sqrt(margins, out=margins)
        margins *= self.quantile
        np.maximum(margins, headway, out=margins)
        margins += chords
        return margins

    def speed_share(
        self, here: Array, command: Array, circles: Array, past: Array | None = None
    ) -> float:
        """Share of a command at which the coming period cannot end in an obstacle, but for the rare error that `STEP_RISK` allows.

        Both speeds shrink by it, so that the robot keeps to its curve. The tube of `margins` is
        computed at the plan before; this looks at the very command that is about to be sent. The
        noise grows with the speed, so a slower robot needs less room.

        Parameters
        ----------
        here, command : ndarray
            Present pose (3,) and the command (2,).
        circles : ndarray
            (M, 5) as they will be at the end of the period; only x, y and radius are used.
        past : ndarray, optional
            Commands already sent (L, 2), for a model with input history: what those still do cannot
            be taken back here.

        Returns
        -------
        float
            Between 0 and 1. A robot that already touches may move away from what it touches.
        """
        if not len(circles):
            self.nearest = math.inf
            return 1.0
        away = here[:2] - circles[:, :2]
        before = np.hypot(away[:, 0], away[:, 1])
        room = before - circles[:, 2] - (self._touch + ROUNDING)
        v, omega = command.tolist()
        self.nearest = float(np.minimum.reduce(room))
        # far from everything, which is most of the time, there is nothing to weigh up
        if (
            self.nearest
            > FAR_PERIODS * abs(v) * self._model.dt + self.step_margin(v, omega) - self._reserve
        ):
            return 1.0
        cos, sin = np.cos(here[2]), np.sin(here[2])
        share = 1.0
        for _ in range(CORRECTIONS):
            part = share * command
            there = self._model.predict(here, part, past)
            after = np.hypot(there[0] - circles[:, 0], there[1] - circles[:, 1])
            approach = before - after
            if self._errs:
                noise = ((part * part) @ self._step).reshape(3, 3)
                ahead, left = away @ (cos, sin), away @ (-sin, cos)
                variance = (
                    ahead * ahead * noise[0, 0]
                    + 2.0 * ahead * left * noise[0, 1]
                    + left * left * noise[1, 1]
                )
                approach += (
                    self._step_quantile
                    * np.sqrt(np.maximum(variance, 0.0))
                    / np.maximum(before, 1e-9)
                )
            # a path that passes by comes nearer between its ends by what a chord cuts off
            distance = np.hypot(there[0] - here[0], there[1] - here[1])
            centres = np.maximum(before, self._touch)
            approach += np.sqrt(centres**2 + 0.25 * distance**2) - centres
            closing = approach > room
            if not closing.any():
                break
            limits = np.where(closing, np.maximum(room, 0.0) / np.maximum(approach, 1e-9), 1.0)
            worst = int(limits.argmin())
            # a robot at the very centre has no way but away
            straight = math.copysign(1.0, v) * float(away[worst] @ (cos, sin))
            if straight >= 0.0:
                least = RETREAT if room[worst] <= 0.0 else RETREAT * straight / float(before[worst])
                return share * max(float(limits[worst]), least)
            # again, for a curve that is driven slowly turns less in the period than the share says
            share *= float(limits[worst])
        return share

    def step_margin(self, v: float, omega: float) -> float:
        """Room [m] that a single command needs in any direction, but for the rare error that `STEP_RISK` allows."""
        variance = v * v * self._step_trace[0] + omega * omega * self._step_trace[1]
        return self._reserve + self._step_quantile * math.sqrt(max(variance, 0.0))

    def covariances(self, lin: Linearization, states: Array, inputs: Array) -> Array:
        """Covariances (N, 2, 2) of the position at stages 1 to N, each from the last `MEMORY` steps before it."""
        spread = self._spread(lin, states, inputs)
        covariances: Array = spread @ spread.transpose(0, 2, 1)
        return covariances

    def _spread(self, lin: Linearization, states: Array, inputs: Array) -> Array:
        """Factors F (N, 2, C) of the covariances, ``F F'``: half the work, and never indefinite. Overwritten by the next call."""
        headings = states[:-1, 2]
        cos, sin = np.cos(headings), np.sin(headings)
        turned = rotations(cos, sin)
        width, span = self._felt_factor.shape[1], 1
        if len(self._wide) != len(inputs):
            self._wide = np.zeros((len(inputs), STATES, (width << self._levels) + STATES))
        wide = self._wide
        np.matmul(
            turned,
            self._felt_factor * inputs.repeat(STATES, axis=1)[:, None],
            out=wide[..., :width],
        )
        jacobians = closed_loop(lin.A, cos, sin, self._feedback)
        # doubling: beside what m steps have spread, what the m steps before them did, moved on by m
        # steps
        for level in range(self._levels):
            if span >= len(wide):
                break
            np.matmul(
                jacobians[span:], wide[:-span, :, :width], out=wide[span:, :, width : 2 * width]
            )
            if level + 1 < self._levels:
                longer = jacobians.copy()
                np.matmul(jacobians[span:], jacobians[:-span], out=longer[span:])
                jacobians = longer
            width, span = 2 * width, 2 * span
        np.matmul(turned[:, :2], self._measured_factor, out=wide[:, :2, -STATES:])
        return wide[:, :2]

    def _chords(self, states: Array, radii: Array | None) -> Array:
        """How far the path between two samples may come closer to a circle than the samples do, (N,) or (N, S) [m].

        A chord of length L whose ends keep a distance D from a centre comes as near as ``sqrt(D^2 -
        L^2 / 4)``, and an arc that turns by phi bulges beyond its chord by ``L phi / 8``: with ``D
        = sqrt((R + bulge)^2 + L^2 / 4)`` the path stays outside R.
        """
        steps = np.abs(states[1:] - states[:-1])
        squares = steps[:, 0] ** 2 + steps[:, 1] ** 2
        bulges = np.sqrt(squares) * steps[:, 2] / 8
        squares /= 4
        # a sample ends one chord and begins the next
        np.maximum(squares[:-1], squares[1:], out=squares[:-1])
        np.maximum(bulges[:-1], bulges[1:], out=bulges[:-1])
        if radii is None:
            radius: Any = self._radius
        else:
            walls = np.isinf(radii)
            radius = np.where(walls, 1e6, radii)
            squares, bulges = squares[:, None], bulges[:, None]
        chords: Array = np.sqrt((radius + bulges) ** 2 + squares) - radius
        return chords


def _factor(covariance: Array) -> Array:
    """Matrix L (n, n) with ``L L'`` the covariance; what rounding has left below zero counts as zero."""
    values, vectors = np.linalg.eigh(covariance)
    factor: Array = vectors * np.sqrt(np.maximum(values, 0.0))
    return factor
