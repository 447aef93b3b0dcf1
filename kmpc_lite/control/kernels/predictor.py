"""Symmetric models in C, in the robot's units: the roll-out and the Jacobians of a step."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.kernels import _kernels as c  # type: ignore[attr-defined]
from kmpc_lite.control.kernels.library import dense
from kmpc_lite.model.arguments import broadcast
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.model.dictionary import InputHistoryDictionary, ResponseDictionary
from kmpc_lite.model.dictionary.base import Dictionary
from kmpc_lite.model.dictionary.response import terms_of
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.motion import MotionModel, ScaledModel
from kmpc_lite.scale import Scale
from kmpc_lite.types import STATES, Array

NONE = np.empty(0)


class Inputs(NamedTuple):
    """What a model is bilinear in: terms of filtered commands (`struct kmpc_predictor`)."""

    kernel: Array  # (G, L + 1, m) weights of commands by their age, newest first, of each group
    terms: tuple[str, ...]  # of each group
    smoothing: tuple[float, ...]  # of each number of a command
    limits: tuple[float, ...]  # of each number of a command, up to which its terms follow
    steered: bool = False  # whether turn rates follow from filtered curvatures

    @classmethod
    def of(cls, dictionary: Dictionary) -> Inputs | None:
        """Inputs of a dictionary; none of one whose inputs are others."""
        m, own = dictionary.commands, type(dictionary).inputs
        plain = (1.0,) * m, (math.inf,) * m
        if isinstance(dictionary, ResponseDictionary) and own is ResponseDictionary.inputs:
            shapes = dictionary.smoothing, dictionary.limits, dictionary.steered
            return cls(dictionary.kernel[None], dictionary.terms, *shapes)
        if isinstance(dictionary, InputHistoryDictionary) and own is InputHistoryDictionary.inputs:
            lags = np.array(dictionary.lags)
            kernel = np.zeros((len(lags), dictionary.history + 1, m))
            kernel[np.arange(len(lags)), lags] = 1.0
            return cls(kernel, terms_of(m)[: m + dictionary.product], *plain)
        if own is not Dictionary.inputs or dictionary.input_size != m:
            return None
        return cls(np.ones((1, 1, m)), terms_of(m)[:m], *plain)

    def by_group(self, rows: Array, dictionary: Dictionary) -> Array:
        """Rows (nw, 3) of a dictionary's inputs in the order of groups."""
        if not isinstance(dictionary, InputHistoryDictionary):
            return rows
        m, groups = dictionary.commands, len(self.kernel)
        linear, products = rows[: m * groups], rows[m * groups :]
        both = (
            linear.reshape(groups, m, STATES),
            products.reshape(groups, len(self.terms) - m, STATES),
        )
        return np.concatenate(both, axis=1)


class Predictor(ScaledModel):
    """A symmetric model that is asked, and answers, in the robot's own units; in C.

    `inputs_of`: of the model's dictionary.
    """

    def __init__(self, model: KoopmanModel, scale: Scale, inputs_of: Inputs) -> None:
        super().__init__(model, scale)
        form, (kernel, terms, smoothing, limits, steered) = model.closed_form, inputs_of
        assert form is not None
        known, self._past_shape = terms_of(model.inputs), (self.history, self.inputs)
        sizes = model.inputs, kernel.shape[1], len(kernel), len(terms), len(form.nodes), steered
        self._layout = np.array([*sizes, *map(known.index, terms)], dtype=np.intc)
        motion = inputs_of.by_group(form.motion, model.dictionary)
        parts = kernel, smoothing, limits, motion, form.nodes, scale.state
        self._numbers = np.concatenate([np.ravel(p) for p in (*parts, self._command)])

    def predict(self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None) -> Array:
        """As `KoopmanModel.predict`, in units."""
        commands = np.asarray(u, dtype=float)
        return self.rollout(x, commands[..., None, :], history)[..., 1, :]

    def rollout(self, x0: ArrayLike, inputs: ArrayLike, history: ArrayLike | None = None) -> Array:
        """As `KoopmanModel.rollout`, in units."""
        x, commands = np.asarray(x0, dtype=float), np.asarray(inputs, dtype=float)
        lead, periods = commands.shape[:-2], commands.shape[-2]
        past = None if history is None or not self.history else np.asarray(history, dtype=float)
        # many may begin at one pose, after the same commands
        if x.shape != (STATES,) or (past is not None and past.shape != self._past_shape):
            x, _, past = broadcast(x, np.empty((*lead, self.inputs)), past, *self._past_shape)
            lead = x.shape[:-1]
            commands = np.broadcast_to(commands, (*lead, periods, self.inputs))
        out = np.empty((*lead, periods + 1, STATES))
        given = dense(x), dense(commands), NONE if past is None else dense(past)
        c.rollout(self._layout, self._numbers, *given, out, periods)
        return out

    def linearize(
        self, x: ArrayLike, u: ArrayLike, history: ArrayLike | None = None
    ) -> Linearization:
        """As `KoopmanModel.linearize`, in units."""
        x, u, past = broadcast(x, u, history, self.history, self.inputs)
        lead, by_command = x.shape[:-1], (STATES, self.inputs)
        value, by_x = np.empty((*lead, STATES)), np.empty((*lead, STATES, STATES))
        by_u, by_past = np.empty((*lead, *by_command)), np.empty((*lead, self.history, *by_command))
        given = dense(x), dense(u), NONE if past is None else dense(past)
        c.linearize(self._layout, self._numbers, *given, value, by_x, by_u, by_past)
        return Linearization(value, by_x, by_u, by_past)


def motion_in_units(model: KoopmanModel, scale: Scale) -> MotionModel:
    """Give a model in the robot's units: in C if it is symmetric and its inputs are terms."""
    inputs = None if model.closed_form is None else Inputs.of(model.dictionary)
    return ScaledModel(model, scale) if inputs is None else Predictor(model, scale, inputs)
