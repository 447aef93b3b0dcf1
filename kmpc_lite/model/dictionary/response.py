"""Inputs of a robot that answers late and slips: a delayed command and smooth slip terms.

A motor's answer is the command filtered by weights over its age, ``vbar = sum_j k_j v(k - j)``: a
dead time and a time constant give the weights. What the robot does then is linear in a few terms of
``(vbar, omegabar)``: linear ones, slip, and gains by direction. Each is a product of one factor of
each speed (see `FACTORS`), and vanishes at rest.

A car's motors answer a speed and a curvature: while it still rolls its steered wheels turn it,
``omegabar = vbar sum_j k_j kappa(k - j)``; wheels that stand still stay as they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ModelError
from kmpc_lite.model.dictionary.base import MAX_LAG, Dictionary, LiftedAsBase, dictionary_to_config
from kmpc_lite.types import INPUTS, Array

WITHIN = (0.5, 0.5)  # how much of a change by a ramp is driven in its period, and in the next one
STANDS = 1e-9  # speed below which a command says nothing of how the wheels are steered [m/s]
ONE, PLAIN, SIZE, SQUARE, CUBE, SIGNED_SQUARE, SIGN = FACTORS = range(7)
"""Of a speed s: 1, s, |s|, s^2, s^3, s|s| and the sign of s. ``|s|`` is smoothed to ``s^2 /
sqrt(s^2 + eps^2)``, which is even, and zero with its slope at zero; the sign is smoothed alike."""
LINEAR = ("v", "omega")  # terms of a robot that does not slip
_TERMS = {
    "v": (PLAIN, ONE),
    "omega": (ONE, PLAIN),
    "v*omega": (PLAIN, PLAIN),
    "v*|omega|": (PLAIN, SIZE),
    "v*omega^2": (PLAIN, SQUARE),
    "v*|v|": (SIGNED_SQUARE, ONE),
    "omega*|omega|": (ONE, SIGNED_SQUARE),
    "omega^3": (ONE, CUBE),
    "v^2*omega": (SQUARE, PLAIN),
    "|v|": (SIZE, ONE),
    "omega*sgn(v)": (SIGN, PLAIN),
}
_OMNI_TERMS = {
    "v": (PLAIN, ONE, ONE),
    "lateral": (ONE, PLAIN, ONE),
    "omega": (ONE, ONE, PLAIN),
    "v*omega": (PLAIN, ONE, PLAIN),
    "lateral*omega": (ONE, PLAIN, PLAIN),
    "v*|v|": (SIGNED_SQUARE, ONE, ONE),
    "lateral*|lateral|": (ONE, SIGNED_SQUARE, ONE),
    "omega*|omega|": (ONE, ONE, SIGNED_SQUARE),
}
TERMS = tuple(_TERMS)  # of robots with two speeds; the C code has them in this order
OMNI_TERMS = tuple(_OMNI_TERMS)  # of robots that drive sideways, too
_KINDS = {len(next(iter(t.values()))): np.array(list(t.values())) for t in (_TERMS, _OMNI_TERMS)}


class ResponseDictionary(LiftedAsBase):
    """A dictionary whose model is driven by filtered commands and their slip terms.

    The model is bilinear in ``w = [terms of (vbar, omegabar)]`` with ``|omega|`` smoothed to
    ``omega^2 / sqrt(omega^2 + eps^2)``, which is even, and zero with its slope at zero. Beyond the
    log's largest speeds the slip terms stay what they are there: cubics extrapolate badly.

    `base`: how the pose is lifted. `speed`, `turn`: weights of the present and of past commands,
    newest first: for v, which are an omni's for its speed to the left, too, and for omega. `terms`:
    which of `terms_of` its commands the model is bilinear in, in this order. `smoothing`: eps of
    each number of a command [m/s, rad/s], > 0. `limits`: largest size of each that the slip terms
    follow [m/s, rad/s]. `steered`: whether `turn` weighs the curvatures of a car's commands instead
    of their turn rates.

    Examples
    --------
    >>> from kmpc_lite.model.dictionary import UnicycleDictionary
    >>> terms = ("v", "omega", "v*omega")
    >>> late = ResponseDictionary(UnicycleDictionary(), speed=(0.25, 0.75), terms=terms)
    >>> late.inputs(np.array([1.0, 0.5]), np.array([[0.0, 0.5]]))
    array([0.25 , 0.5  , 0.125])
    """

    kind = "response"

    def __init__(
        self,
        base: Dictionary,
        speed: Sequence[float] = (1.0,),
        turn: Sequence[float] = (1.0,),
        terms: Sequence[str] = LINEAR,
        smoothing: Sequence[float] = (0.05, 0.05),
        limits: Sequence[float] = (1e6, 1e6),
        steered: bool = False,
    ) -> None:
        if base.history:
            raise ModelError("ResponseDictionary: its base must not have an input history itself")
        self.base = base
        self.speed, self.turn = _weights("speed", speed), _weights("turn", turn)
        m, self.terms = base.commands, tuple(terms)
        known = terms_of(m)
        if (
            not self.terms
            or len(set(self.terms)) != len(self.terms)
            or not set(self.terms) <= set(known)
        ):
            raise ModelError(
                f"ResponseDictionary: terms must be different ones of {known}, got {terms}"
            )
        self.smoothing = _positive("smoothing", smoothing, m)
        self.limits = _positive("limits", limits, m)
        self.steered = bool(steered)
        if self.steered and m != INPUTS:
            raise ModelError("ResponseDictionary: a robot that drives sideways is not steered")
        self._history = max(len(self.speed), len(self.turn)) - 1
        # (1 + L, m), newest first; the past ones oldest first too, as histories come
        self.kernel = np.zeros((1 + self._history, m))
        self.kernel[: len(self.speed), :-1] = np.array(self.speed)[:, None]
        self.kernel[: len(self.turn), -1] = self.turn
        self._past = np.ascontiguousarray(self.kernel[:0:-1])
        self._columns = np.array([known.index(t) for t in self.terms])

    @property
    def history(self) -> int:
        """The age of the oldest command that acts."""
        return self._history

    @property
    def input_size(self) -> int:
        """One for each term."""
        return len(self.terms)

    def answered(self, u: Array, history: Array | None = None) -> Array:
        """Filtered commands (vbar, omegabar), (..., m): what the motors make of the commands."""
        if self.steered:
            return self._steered(u, history)[0]
        now: Array = u * self.kernel[0]
        if history is None or not self._history:
            return now
        past: Array = now + (history * self._past).sum(axis=-2)
        return past

    def inputs(self, u: Array, history: Array | None = None) -> Array:
        """Terms of the filtered commands, (..., nw)."""
        w: Array = evaluate_terms(self.answered(u, history), self.smoothing, self.limits)[
            ..., self._columns
        ]
        return w

    def inputs_jacobian(self, u: Array, history: Array | None = None) -> Array | None:
        """Slopes of `inputs` to steer by: (..., nw, 1 + L, m), by each age's command, newest first.

        Its derivatives but for ``|omega|`` and ``omega^2`` (`differentiate_terms`).
        """
        if self.steered:
            answered, by_command = self._steered(u, history)
        else:
            answered = self.answered(u, history)
        slopes = differentiate_terms(answered, self.smoothing, self.limits)[..., self._columns, :]
        jac: Array = slopes[..., None, :] * self.kernel
        if self.steered:
            # omegabar follows v and omega, vbar follows v alone
            jac[..., 1] = slopes[..., None, 1] * by_command[..., None, :, 1]
            jac[..., 0] += slopes[..., None, 1] * by_command[..., None, :, 0]
        return jac

    def _steered(self, u: Array, history: Array | None) -> tuple[Array, Array]:
        """Filtered commands (..., 2) of a car, and what omegabar follows, (..., 1 + L, 2).

        Slopes are those of curvatures that fade below the smoothing speed: they are finite at rest,
        where a turn rate is followed as by any robot.
        """
        commands = u[..., None, :]
        if self._history and history is not None:
            commands = np.concatenate([history, commands], axis=-2)
        curvatures = held_curvatures(commands)[..., ::-1]
        speeds = commands[..., ::-1, 0]
        count = curvatures.shape[-1]
        kernel = self.kernel[:count]
        v = (speeds * kernel[:, 0]).sum(axis=-1)
        curvature = (curvatures * kernel[:, 1]).sum(axis=-1)
        soft = self.smoothing[0] ** 2
        shares = (v[..., None] * speeds + soft) / (speeds**2 + soft)
        by_command = np.zeros((*v.shape, len(self.kernel), INPUTS))
        by_command[..., :count, 1] = kernel[:, 1] * shares
        by_command[..., :count, 0] = kernel[:, 0] * curvature[..., None]
        by_command[..., :count, 0] -= kernel[:, 1] * curvatures * shares
        return np.stack([v, v * curvature], axis=-1), by_command

    def config(self) -> dict[str, Any]:
        """Give base, weights, terms, smoothing and limits."""
        return {
            "base": dictionary_to_config(self.base),
            "speed": list(self.speed),
            "turn": list(self.turn),
            "terms": list(self.terms),
            "smoothing": list(self.smoothing),
            "limits": list(self.limits),
            **({"steered": True} if self.steered else {}),
        }


def driven_by_ramps(dictionary: Dictionary, limited: Array) -> Dictionary:
    """Give an answer of one period two where a command is followed by a ramp, (m,).

    Half of its change is driven in its period, half in the next one: a log whose floor slips much
    may not show it.
    """
    if not isinstance(dictionary, ResponseDictionary):
        return dictionary
    both = (dictionary.speed, limited[:-1].any()), (dictionary.turn, limited[-1])
    speed, turn = (WITHIN if ramped and len(weights) == 1 else weights for weights, ramped in both)
    told = dictionary.terms, dictionary.smoothing, dictionary.limits, dictionary.steered
    return ResponseDictionary(dictionary.base, speed, turn, *told)


def _weights(name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Check the weights of one answer."""
    weights = tuple(float(v) for v in values)
    if not 1 <= len(weights) <= MAX_LAG + 1 or not np.isfinite(weights).all():
        raise ModelError(
            f"ResponseDictionary: {name}: expected 1 to {MAX_LAG + 1} finite weights, "
            f"got {values!r:.60}"
        )
    return weights


def _positive(name: str, values: Sequence[float], count: int) -> tuple[float, ...]:
    """Check so many positive numbers."""
    found = tuple(float(v) for v in values)
    if len(found) != count or not (np.isfinite(found).all() and min(found) > 0.0):
        raise ModelError(
            f"ResponseDictionary: {name}: expected {count} numbers > 0, one for each of a "
            f"command, got {values!r:.60}"
        )
    return found


def held_curvatures(commands: Array) -> Array:
    """Curvatures (..., T) [1/m] of commands v, omega (..., T, 2) in order of time.

    A command that stands keeps the curvature before it; before the first that drives it is zero.

    Examples
    --------
    >>> held_curvatures(np.array([(0.0, 0.0), (2.0, 1.0), (0.0, 0.0)]))
    array([0. , 0.5, 0.5])
    """
    v, omega = commands[..., 0], commands[..., 1]
    drives = np.abs(v) > STANDS
    found = np.where(drives, omega, 0.0) / np.where(drives, v, 1.0)
    if drives.all():
        return found
    last = np.maximum.accumulate(np.where(drives, np.arange(v.shape[-1]), 0), axis=-1)
    held: Array = np.take_along_axis(found, last, axis=-1)
    return held


def terms_of(commands: int) -> tuple[str, ...]:
    """Terms of a robot whose commands are so many numbers; the first of them are linear."""
    return TERMS if commands == INPUTS else OMNI_TERMS


def evaluate_terms(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """All terms of filtered commands (..., m): (..., T).

    Beyond the limits, the log's largest speeds, all but the linear ones stay what they are there.
    """
    m = answered.shape[-1]
    out: Array = np.prod(_chosen(_factors(answered, smoothing, limits)), axis=-2)
    out[..., :m] = answered
    return out


def differentiate_terms(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """Slopes of `evaluate_terms` by the filtered commands, by which plans are steered: (..., T, m).

    They are its derivatives but for ``|omega|`` and ``omega^2``, whose slopes are zero here:
    turning either way costs speed. That is predicted, not steered with. Linearised where it turns
    left, less turning is more speed, where it turns right the reverse, and a plan that steers by
    that jumps across in every period.
    """
    m = answered.shape[-1]
    factors = _chosen(_factors(answered, smoothing, limits))
    slopes = _chosen(_slopes(answered, smoothing, limits))
    out = np.empty((*answered.shape[:-1], factors.shape[-1], m))
    for j in range(m):
        others = np.prod(np.delete(factors, j, axis=-2), axis=-2)
        out[..., j] = others * slopes[..., j, :]
    out[..., :m, :] = np.eye(m)
    return out


def _chosen(factors: Array) -> Array:
    """Factor of each speed in each term, (..., m, T): factors (..., m, F)."""
    m = factors.shape[-2]
    found: Array = factors[..., np.arange(m)[:, None], _KINDS[m].T]
    return found


def _factors(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """`FACTORS` of each speed, (..., m, F)."""
    most = np.asarray(limits)
    s = np.clip(answered, -most, most)
    square = s * s
    root = np.sqrt(square + np.square(np.asarray(smoothing)))
    size = square / root
    return np.stack([np.ones_like(s), s, size, square, s * square, s * size, s / root], axis=-1)


def _slopes(answered: Array, smoothing: ArrayLike, limits: ArrayLike) -> Array:
    """Slopes of `_factors` by the speed, (..., m, F); see `differentiate_terms`."""
    most, soft = np.asarray(limits), np.square(np.asarray(smoothing))
    s = np.clip(answered, -most, most)
    square = s * s
    cube = (square + soft) * np.sqrt(square + soft)
    size, steep = square / np.sqrt(square + soft), s * (square + 2.0 * soft) / cube
    none, one = np.zeros_like(s), np.ones_like(s)
    found = [none, one, steep, 2.0 * s, 3.0 * square, size + s * steep, soft / cube]
    out: Array = np.stack(found, axis=-1) * (np.abs(answered) <= most)[..., None]
    out[..., -1, [SIZE, SQUARE]] = 0.0
    return out
