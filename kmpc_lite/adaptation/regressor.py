"""One period as a row of the regression: the motion that the model predicts, and the measured one.

The model's displacement is its generator integrated between the two measured poses (Simpson's
rule), as in the integral fit.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, isfinite, pi, remainder, sin

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.adaptation.columns import AS_MEASURED, HEADING, MOTION, SPEEDS, WEIGHTS
from kmpc_lite.adaptation.gains import whitening
from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.adaptation.state import NO_STEPS, AdaptationState
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import UNIT_RADIUS, Scale
from kmpc_lite.types import INPUTS, STATES, Array

SIMPSON = np.array([1.0, 4.0, 1.0]) / 6.0


class Regressor:
    """Turns periods into rows of the regression, and leaves out those without information.

    Parameters
    ----------
    model : KoopmanModel
        The learned one.
    options : AdaptationOptions
        Thresholds below which a step counts as still or held, and above which as broken.
    scale : Scale
        The robot's units.
    memory : int
        Steps that are kept.
    """

    def __init__(
        self, model: KoopmanModel, options: AdaptationOptions, scale: Scale, memory: int
    ) -> None:
        self._dictionary, self._dt, self._memory = model.dictionary, model.dt, memory
        self._closed_form = model.closed_form
        radius = scale.length * UNIT_RADIUS
        self._least_step, self._least_turn = options.least_step * radius, options.least_turn
        self._jump_factor = options.jump_factor
        self._jump, self._jump_turn = options.jump * radius, options.jump_turn
        self._held, self._held_turn = options.held * radius, options.held_turn
        self._held_share, self._even = options.held_share, options.even_noise
        self.floors = (options.noise_floor * radius) ** 2, options.turn_noise_floor**2
        """Least variance of a step's position [m^2], and of its turn [rad^2]."""
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
        self._carried, self.white = whitening(coefficients, model.dt, scale)
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
        """What one step adds to the sums, or None where it tells nothing; the raw step is kept."""
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
        if moved < self._least_step and abs(h) < self._least_turn:
            self._leave_out(state, rejected=False)
            return None
        if self._is_held(moved, h, drove, turned) or self._jumped(moved, h, drove, turned):
            self._leave_out(state, rejected=True)
            return None
        state.counts.used += 1
        v, omega = numbers[6:]
        a, b = self._weigh(state, v * v, omega * omega)
        # a step that hardly moves, or turns, says nothing about moving, or turning
        if not moved >= self._least_step:
            a = 0.0
        if not (abs(h) >= self._least_turn or abs(g) >= self._least_step):
            b = 0.0
        # noise of a pose makes one step longer and the next one shorter: the fading sums take that
        # back
        own, earlier, (c, d) = (px, py, dx, dy, h, g, turned), state.earlier, self._carried
        px, py, dx, dy = (
            px + c * earlier[0],
            py + c * earlier[1],
            dx + c * earlier[2],
            dy + c * earlier[3],
        )
        h, g, turned = h + d * earlier[4], g + d * earlier[5], turned + d * earlier[6]
        state.earlier = px, py, dx, dy, h, g, turned
        a, b = a / self.white[0], b / self.white[1]
        raw = state.raw[state.count % self._memory]
        raw[MOTION], raw[AS_MEASURED] = state.earlier, own
        raw[WEIGHTS], raw[SPEEDS] = (a, b), (v * v, omega * omega)
        raw[HEADING] = cos(heading), sin(heading)
        position = a * (px * px + py * py), a * (px * dx + py * dy), a * (px * dy - py * dx)
        turns = b * h * h, b * h * g, b * g * g, b * h * turned, b * g * turned
        rest = b * turned * turned, float(a > 0.0), float(b > 0.0)
        return [*position, a * (dx * dx + dy * dy), *turns, *rest]

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
        share = self._held_share
        return (
            (moved > self._held or abs(h) > self._held_turn)
            and drove < share * moved + self._held * share
            and abs(turned) < share * abs(h) + self._held_turn * share
        )

    def _jumped(self, moved: float, h: float, drove: float, turned: float) -> bool:
        """Whether the pose moved farther than any floor lets it."""
        factor = self._jump_factor
        return (
            drove > factor * moved + self._jump or abs(turned) > factor * abs(h) + self._jump_turn
        )

    def _weigh(self, state: AdaptationState, v2: float, omega2: float) -> tuple[float, float]:
        """Weights of a step's position and turn: one over its variance and a share of the usual."""
        p, q = state.position_noise, state.heading_noise
        a = p[0] + p[1] * v2 + p[2] * omega2 + self.floors[0]
        b = q[0] + q[1] * v2 + q[2] * omega2 + self.floors[1]
        share = 1.0 / min(state.count + 1, self._memory)
        first, second = state.usual
        state.usual = first + share * (a - first), second + share * (b - second)
        return 1.0 / (a + self._even * state.usual[0]), 1.0 / (b + self._even * state.usual[1])


def one_period(
    x: ArrayLike, u: ArrayLike, x_next: ArrayLike, history: ArrayLike | None, length: int
) -> tuple[Array, Array, Array, Array | None]:
    """Pose before, command, pose after and the `length` commands before, as checked arrays.

    Raises
    ------
    ValueError
        For wrong shapes.
    """
    before, command, after = (np.asarray(value, dtype=float) for value in (x, u, x_next))
    if before.shape != (STATES,) or command.shape != (INPUTS,) or after.shape != (STATES,):
        raise ValueError(
            f"expected x ({STATES},), u ({INPUTS},), x_next ({STATES},), "
            f"got {before.shape}, {command.shape}, {after.shape}"
        )
    if history is None or not length:
        return before, command, after, None
    past = np.asarray(history, dtype=float)
    if past.shape != (length, INPUTS):
        raise ValueError(f"history: expected shape ({length}, {INPUTS}), got {past.shape}")
    return before, command, after, past
