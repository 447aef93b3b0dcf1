"""One period as a row of the regression: the motion that the model predicts, and the measured one.

The model's displacement is its generator integrated between the two measured poses (Simpson's
rule), as in the integral fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, isfinite, pi, remainder, sin

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.adapted_model import drives_sideways
from kmpc_lite.adaptation.gains import reweighed_sums, sums_of, whitening
from kmpc_lite.adaptation.state import (
    AS_MEASURED,
    HEADING,
    MOTION,
    NO_STEPS,
    SPEEDS,
    WEIGHTS,
    AdaptationState,
)
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import STATES, Array

LEAST_STEP, LEAST_TURN = 1 / 75, 2e-3
"""A step that should move the robot less [radii], or turn it less [rad], tells nothing of them."""
JUMP_FACTOR, JUMP, JUMP_TURN = 3.0, 1 / 3, 0.15
"""A pose that moved more than this many times what was commanded, and this much more [radii, rad],
is a broken measurement, not a floor."""
HELD, HELD_TURN, HELD_SHARE = 2 / 15, 0.03, 0.1
"""A robot that should move by more [radii, rad] and does next to nothing, this share of it, is
held: by brakes, a wall, a pilot."""
NOISE_FLOOR, TURN_NOISE_FLOOR = 1 / 300, 5e-4
"""Smallest noise that a step [radii] and its turn [rad] have: what poses are measured to."""
EVEN_NOISE = 0.3
"""Share of the usual noise that is added to every step's own: without it, the few slowest steps
would outweigh all others where poses are noisy."""
SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


class Regressor:
    """Turns periods into rows of the regression, and leaves out those without information.

    Parameters
    ----------
    model : KoopmanModel
        The learned one.
    scale : Scale
        The robot's units.
    memory : int
        Steps that are kept.
    """

    def __init__(self, model: KoopmanModel, scale: Scale, memory: int) -> None:
        self._dictionary, self._dt, self._memory = model.dictionary, model.dt, memory
        self._closed_form, self._drives_sideways = model.closed_form, drives_sideways(model)
        radius = scale.length * UNIT_RADIUS
        self._least_step, self._jump, self._held = LEAST_STEP * radius, JUMP * radius, HELD * radius
        self._floors = (NOISE_FLOOR * radius) ** 2, TURN_NOISE_FLOOR**2
        nz, nw = model.dictionary.size, model.dictionary.input_size
        terms = np.concatenate([model.A[None], model.H.reshape(STATES, nw, nz).transpose(1, 0, 2)])
        self.responses = (terms[1:] @ model.dictionary.lift(np.zeros(STATES)) + model.B.T)[:, 0]
        """(nw,) how much each bilinear input drives the robot ahead."""
        # by (1, inputs): four rows, of the pose's three velocities and the speed ahead, that act on
        # the lifted state and a one
        rates = np.zeros((1 + nw, STATES + 1, nz + 1))
        rates[:, :STATES, :nz] = terms
        rates[1:, :STATES, nz], rates[1:, STATES, nz] = model.B.T, self.responses
        self._rates = rates.reshape(1 + nw, -1)
        noise = model.noise_model
        coefficients = np.zeros((3, STATES, STATES)) if noise is None else noise.coefficients
        self._carried, self._white = whitening(coefficients, model.dt, scale)
        self._weights, self._lifted = np.ones(1 + nw), np.ones(nz + 1)
        self._points = np.empty((3, STATES))

    def row(
        self,
        state: AdaptationState,
        before: Array,
        command: Array,
        after: Array,
        past: Array | None,
    ) -> list[float] | None:
        """What one step adds to the sums, or None if it tells nothing; the raw step is kept."""
        numbers = [*before.tolist(), *after.tolist(), *command.tolist()]
        was_after, state.after = state.after, tuple(numbers[3:6])
        if tuple(numbers[:3]) != was_after:
            state.earlier = NO_STEPS
        known = past is None or bool(np.isfinite(past).all())
        if not (isfinite(sum(numbers)) and known):
            self._leave_out(state, rejected=True)
            return None
        # as the controller does: a model may have learned something of the heading itself, within
        # one turn
        heading = remainder(numbers[2], 2 * pi)
        dx, dy = numbers[3] - numbers[0], numbers[4] - numbers[1]
        turned = remainder(numbers[5] - numbers[2], 2 * pi)
        px, py, h, g = self._given(numbers, heading, dx, dy, turned, command, past)
        moved, drove = hypot(px, py), hypot(dx, dy)
        if moved < self._least_step and abs(h) < LEAST_TURN:
            self._leave_out(state, rejected=False)
            return None
        if self._is_held(moved, h, drove, turned) or self._jumped(moved, h, drove, turned):
            self._leave_out(state, rejected=True)
            return None
        state.counts.used += 1
        v2, omega2 = sum(speed * speed for speed in numbers[6:-1]), numbers[-1] * numbers[-1]
        a, b = self._weigh(state, v2, omega2)
        # a step that hardly moves, or turns, says nothing about moving, or turning
        if not moved >= self._least_step:
            a = 0.0
        if not (abs(h) >= LEAST_TURN or abs(g) >= self._least_step):
            b = 0.0
        # noise of a pose makes one step longer and the next one shorter: the fading sums take that
        # back
        sx, sy = self._aside(heading + 0.5 * turned, px, py)
        own, earlier, (c, d) = (px, py, dx, dy, h, g, turned, sx, sy), state.earlier, self._carried
        px, py, dx, dy = (
            px + c * earlier[0],
            py + c * earlier[1],
            dx + c * earlier[2],
            dy + c * earlier[3],
        )
        h, g, turned = h + d * earlier[4], g + d * earlier[5], turned + d * earlier[6]
        sx, sy = sx + c * earlier[7], sy + c * earlier[8]
        state.earlier = px, py, dx, dy, h, g, turned, sx, sy
        a, b = a / self._white[0], b / self._white[1]
        raw = state.raw[state.count % self._memory]
        raw[MOTION], raw[AS_MEASURED] = state.earlier, own
        raw[WEIGHTS], raw[SPEEDS] = (a, b), (v2, omega2)
        raw[HEADING] = cos(heading), sin(heading)
        return sums_of(state.earlier, a, b)

    def _aside(self, heading: float, px: float, py: float) -> tuple[float, float]:
        """Part of a displacement that an omni's wheels drive sideways at a heading halfway."""
        if not self._drives_sideways:
            return 0.0, 0.0
        cosine, sine = cos(heading), sin(heading)
        left = cosine * py - sine * px
        return -sine * left, cosine * left

    def _given(
        self,
        numbers: list[float],
        heading: float,
        dx: float,
        dy: float,
        turned: float,
        command: Array,
        past: Array | None,
    ) -> Sequence[float]:
        """Displacement x, y, turn and distance ahead that the model gives between two poses."""
        w = self._dictionary.inputs(command, past)
        if self._closed_form is not None:
            return self._closed_form.displacement(heading, turned, w)
        points = self._points
        points[0] = numbers[0], numbers[1], heading
        points[2] = numbers[3], numbers[4], heading + turned
        points[1] = (
            numbers[0] + 0.5 * dx,
            numbers[1] + 0.5 * dy,
            heading + 0.5 * turned,
        )
        np.matmul(SIMPSON, self._dictionary.lift(points), out=self._lifted[:-1])
        self._weights[1:] = w
        rates = (self._weights @ self._rates).reshape(STATES + 1, -1)
        given: list[float] = ((rates @ self._lifted) * self._dt).tolist()
        return given

    def _leave_out(self, state: AdaptationState, rejected: bool) -> None:
        if rejected:
            state.counts.rejected += 1
        else:
            state.counts.still += 1
        state.earlier = NO_STEPS

    def _is_held(self, moved: float, h: float, drove: float, turned: float) -> bool:
        """Whether the robot should have moved and did next to nothing."""
        share = HELD_SHARE
        return (
            (moved > self._held or abs(h) > HELD_TURN)
            and drove < share * moved + self._held * share
            and abs(turned) < share * abs(h) + HELD_TURN * share
        )

    def _jumped(self, moved: float, h: float, drove: float, turned: float) -> bool:
        """Whether the pose moved farther than any floor lets it."""
        factor = JUMP_FACTOR
        return drove > factor * moved + self._jump or abs(turned) > factor * abs(h) + JUMP_TURN

    def _weigh(self, state: AdaptationState, v2: float, omega2: float) -> tuple[float, float]:
        """Weights of a step's position and turn: one over its variance and a share of the usual."""
        p, q = state.position_noise, state.heading_noise
        a = p[0] + p[1] * v2 + p[2] * omega2 + self._floors[0]
        b = q[0] + q[1] * v2 + q[2] * omega2 + self._floors[1]
        share = 1.0 / min(state.count + 1, self._memory)
        first, second = state.usual
        state.usual = first + share * (a - first), second + share * (b - second)
        return 1.0 / (a + EVEN_NOISE * state.usual[0]), 1.0 / (b + EVEN_NOISE * state.usual[1])

    def reweigh(self, state: AdaptationState, coefficients: Array) -> None:
        """Weigh the steps since the change anew, by the present estimate of their noise (3, 3, 3).

        With the old weights, the tails of a larger noise would look like changes.
        """
        state.weigh_by(coefficients)
        window, memory = len(state.recent), len(state.raw)
        count = min(state.since, memory)
        kept = state.kept(count)
        steps = state.raw[kept]
        sums, usual = reweighed_sums(
            steps,
            np.array([state.position_noise, state.heading_noise]),
            np.array(self._floors),
            np.array(self._white),
            EVEN_NOISE,
        )
        state.raw[kept], state.usual = steps, usual
        recent = min(count, window)
        state.recent[(state.count - 1 - np.arange(recent)) % window] = sums[:recent]
        fading = (1.0 - 1.0 / memory) ** np.arange(count)
        state.slow, state.slow_count = fading @ sums, float(fading.sum())


def one_period(
    x: ArrayLike, u: ArrayLike, x_next: ArrayLike, history: ArrayLike | None, model: KoopmanModel
) -> tuple[Array, Array, Array, Array | None]:
    """Pose before, command, pose after and the commands before that a model needs, as arrays.

    Raises
    ------
    ValueError
        For wrong shapes.
    """
    before, command, after = (np.asarray(value, dtype=float) for value in (x, u, x_next))
    if before.shape != (STATES,) or command.shape != (model.inputs,) or after.shape != (STATES,):
        raise ValueError(
            f"expected x ({STATES},), u ({model.inputs},), x_next ({STATES},), "
            f"got {before.shape}, {command.shape}, {after.shape}"
        )
    if history is None or not model.history:
        return before, command, after, None
    past = np.asarray(history, dtype=float)
    if past.shape != (model.history, model.inputs):
        expected = (model.history, model.inputs)
        raise ValueError(f"history: expected shape {expected}, got {past.shape}")
    return before, command, after, past
