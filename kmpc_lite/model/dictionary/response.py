"""Inputs of a robot that answers late and slips: a delayed command and smooth slip terms.

A motor's answer is the command filtered by weights over its age, ``vbar = sum_j k_j v(k - j)``: a
dead time and a time constant give the weights. What the robot does then is linear in a few terms of
``(vbar, omegabar)`` that vanish at rest.

A car's motors answer a speed and a curvature: while it still rolls its steered wheels turn it,
``omegabar = vbar sum_j k_j kappa(k - j)``.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.model.dictionary.base import MAX_LAG, Dictionary, LiftedAsBase, dictionary_to_config
from kmpc_lite.model.dictionary.curvature import held_curvatures
from kmpc_lite.types import INPUTS, Array

LINEAR = ("v", "omega")
"""Terms of a robot that does not slip."""
SLIP = (
    "v*omega",
    "v*|omega|",
    "v*omega^2",
    "v*|v|",
    "omega*|omega|",
    "omega^3",
    "v^2*omega",
)
"""Terms by which a robot slips; each vanishes at rest."""
TERMS = LINEAR + SLIP


class ResponseDictionary(LiftedAsBase):
    """A dictionary whose model is driven by filtered commands and their slip terms.

    The model is bilinear in ``w = [terms of (vbar, omegabar)]`` with ``|omega|`` smoothed to
    ``omega^2 / sqrt(omega^2 + eps^2)``, which is even, and zero with its slope at zero. Beyond the
    log's largest speeds the slip terms stay what they are there: cubics extrapolate badly.

    Parameters
    ----------
    base : Dictionary
        How the pose is lifted.
    speed, turn : sequence of float
        Weights of the present and of past commands, newest first, for v and for omega.
    terms : sequence of str
        Which of `TERMS` the model is bilinear in, in this order.
    smoothing : tuple of float
        eps for v [m/s] and for omega [rad/s], > 0.
    limits : tuple of float
        Largest |v| [m/s] and |omega| [rad/s] that the slip terms follow.
    steered : bool
        Whether `turn` weighs the curvatures of a car's commands instead of their turn rates.

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
        smoothing: tuple[float, float] = (0.05, 0.05),
        limits: tuple[float, float] = (1e6, 1e6),
        steered: bool = False,
    ) -> None:
        if base.history:
            raise ModelError("ResponseDictionary: its base must not have an input history itself")
        self.base = base
        self.speed, self.turn = _weights("speed", speed), _weights("turn", turn)
        self.terms = tuple(terms)
        if (
            not self.terms
            or len(set(self.terms)) != len(self.terms)
            or not set(self.terms) <= set(TERMS)
        ):
            raise ModelError(
                f"ResponseDictionary: terms must be different ones of {TERMS}, got {terms}"
            )
        self.smoothing = _two("smoothing", smoothing)
        self.limits = _two("limits", limits)
        self.steered = bool(steered)
        self._history = max(len(self.speed), len(self.turn)) - 1
        # (1 + L, 2), newest first; the past ones oldest first too, as histories come
        self.kernel = np.zeros((1 + self._history, INPUTS))
        self.kernel[: len(self.speed), 0] = self.speed
        self.kernel[: len(self.turn), 1] = self.turn
        self._past = np.ascontiguousarray(self.kernel[:0:-1])
        self._columns = np.array([TERMS.index(t) for t in self.terms])

    @property
    def history(self) -> int:
        """The age of the oldest command that acts."""
        return self._history

    @property
    def input_size(self) -> int:
        """One for each term."""
        return len(self.terms)

    def answered(self, u: Array, history: Array | None = None) -> Array:
        """Filtered commands (vbar, omegabar), (..., 2): what the motors make of the commands."""
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
        """Differentiate `inputs`: (..., nw, 1 + L, 2), by the command of each age, newest first."""
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


def evaluate_terms(
    answered: Array, smoothing: tuple[float, float], limits: tuple[float, float]
) -> Array:
    """All `TERMS` of filtered commands (..., 2): (..., 9)."""
    out = np.empty((*answered.shape[:-1], len(TERMS)))
    out[..., :2] = answered
    v = np.clip(answered[..., 0], -limits[0], limits[0])
    o = np.clip(answered[..., 1], -limits[1], limits[1])
    vv, oo = v * v, o * o
    out[..., 2] = v * o
    size = oo / np.sqrt(oo + smoothing[1] ** 2)
    out[..., 3] = v * size
    out[..., 4] = v * oo
    out[..., 5] = v * (vv / np.sqrt(vv + smoothing[0] ** 2))
    out[..., 6] = o * size
    out[..., 7] = o * oo
    out[..., 8] = vv * o
    return out


def differentiate_terms(
    answered: Array, smoothing: tuple[float, float], limits: tuple[float, float]
) -> Array:
    """Differentiate `evaluate_terms` by vbar and omegabar: (..., 9, 2)."""
    out = np.zeros((*answered.shape[:-1], len(TERMS), INPUTS))
    out[..., 0, 0] = out[..., 1, 1] = 1.0
    v = np.clip(answered[..., 0], -limits[0], limits[0])
    o = np.clip(answered[..., 1], -limits[1], limits[1])
    vv, oo = v * v, o * o
    o_root = oo + smoothing[1] ** 2
    size = oo / np.sqrt(o_root)
    size_slope = o * (oo + 2.0 * smoothing[1] ** 2) / (o_root * np.sqrt(o_root))
    v_root = vv + smoothing[0] ** 2
    v_size = vv / np.sqrt(v_root)
    out[..., 2, 0], out[..., 2, 1] = o, v
    out[..., 3, 0], out[..., 3, 1] = size, v * size_slope
    out[..., 4, 0], out[..., 4, 1] = oo, 2.0 * v * o
    out[..., 5, 0] = v_size + vv * (vv + 2.0 * smoothing[0] ** 2) / (v_root * np.sqrt(v_root))
    out[..., 6, 1] = size + o * size_slope
    out[..., 7, 1] = 3.0 * oo
    out[..., 8, 0], out[..., 8, 1] = 2.0 * v * o, vv
    out[..., 2:, 0] *= np.abs(answered[..., :1]) <= limits[0]
    out[..., 2:, 1] *= np.abs(answered[..., 1:]) <= limits[1]
    return out


def _weights(name: str, values: Sequence[float]) -> tuple[float, ...]:
    """Check the weights of one answer."""
    weights = tuple(float(v) for v in values)
    if not 1 <= len(weights) <= MAX_LAG + 1 or not np.isfinite(weights).all():
        raise ModelError(
            f"ResponseDictionary: {name}: expected 1 to {MAX_LAG + 1} finite weights, "
            f"got {values!r:.60}"
        )
    return weights


def _two(name: str, values: Sequence[float]) -> tuple[float, float]:
    """Check two positive numbers."""
    pair = tuple(float(v) for v in values)
    if len(pair) != INPUTS or not (np.isfinite(pair).all() and min(pair) > 0.0):
        raise ModelError(
            f"ResponseDictionary: {name}: expected two numbers > 0, for v and omega, "
            f"got {values!r:.60}"
        )
    return pair[0], pair[1]
