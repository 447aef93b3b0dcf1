"""Symmetric models in closed form: the same motion wherever the robot stands and faces.

A symmetric fit, the nominal unicycle and what adaptation makes of them are the bilinear form of
``xdot = R(theta) [a; b] w, thetadot = g w`` (`kmpc_lite.learn.regression`). While the inputs are
held the heading turns evenly, so that a Runge-Kutta step needs no stages: it is the motion in the
robot's frame, turned by the heading at each node. That is the same step in a fifth of the time,
and a whole path takes no longer than a step.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import NamedTuple

import numpy as np

from kmpc_lite.model.bilinear import BilinearForm
from kmpc_lite.model.dictionary import Dictionary
from kmpc_lite.types import STATES, Array

ROUNDING = 1e-14  # share of the largest coefficient by which symmetric ones may differ


class Trigonometry(NamedTuple):
    """Places of 1, cos(theta) and sin(theta) in a dictionary's lifted state."""

    one: int
    cos: int
    sin: int


def find_trigonometry(dictionary: Dictionary) -> Trigonometry | None:
    """Places of 1, cos(theta) and sin(theta) in the lifted state; None if it lacks one."""
    names = dictionary.names
    cos = next((n for n in ("cos", "cos(theta)") if n in names), None)
    sin = next((n for n in ("sin", "sin(theta)") if n in names), None)
    if "1" not in names or cos is None or sin is None:
        return None
    return Trigonometry(names.index("1"), names.index(cos), names.index(sin))


@dataclass(frozen=True, eq=False)
class SymmetricForm:
    """One period of a symmetric model."""

    motion: Array  # how far each input leads ahead, to the left and round in a period, (nw, 3)
    nodes: tuple[tuple[float, float], ...]  # node and weight of each stage of the integrator

    @classmethod
    def fold(
        cls, form: BilinearForm, dt: float, tableau: Sequence[tuple[float, float]]
    ) -> SymmetricForm | None:
        """Fold the derivative of a state further; None if it is not symmetric.

        `form`: of the model. `dt`: period [s]. `tableau`: node and weight of each stage.
        """
        dictionary, B = form.dictionary, form.B
        place = find_trigonometry(dictionary)
        if place is None or form.A.any() or B[:2].any() or not _lifts(dictionary, place):
            return None
        # by row, input and lifted coordinate
        blocks = form.H_by_input.reshape(B.shape[1], STATES, -1).transpose(1, 0, 2)
        along, across = blocks[0, :, place.cos], blocks[1, :, place.cos]
        heading = B[2] + blocks[2, :, place.one]
        expected = np.zeros_like(blocks)
        expected[0, :, place.cos] = expected[1, :, place.sin] = along
        expected[0, :, place.sin], expected[1, :, place.cos] = -across, across
        expected[2, :, place.one] = blocks[2, :, place.one]
        if not (np.abs(blocks - expected) <= ROUNDING * np.abs(blocks).max(initial=0.0)).all():
            return None
        nodes: dict[float, float] = {}
        for node, weight in tableau:
            if weight:
                nodes[node] = nodes.get(node, 0.0) + weight
        return cls(dt * np.stack([along, across, heading], axis=1), tuple(nodes.items()))

    def advance(self, x: Array, w: Array) -> Array:
        """Next states (..., 3) for bilinear inputs (..., nw)."""
        body = w @ self.motion
        out: Array = x + self._displacements(x[..., 2], body)
        return out

    def rollout(self, x0: Array, w: Array) -> Array:
        """States (..., T + 1, 3) from a first one (..., 3), for inputs (..., T, nw)."""
        body = w @ self.motion
        out = np.empty((*w.shape[:-2], w.shape[-2] + 1, STATES))
        out[..., 0, :] = x0
        out[..., 1:, 2] = body[..., 2]
        # sums in the order of time, as step by step
        headings = np.cumsum(out[..., 2], axis=-1)
        out[..., 1:, :] = self._displacements(headings[..., :-1], body)
        return np.cumsum(out, axis=-2)

    def linearize(self, x: Array, w: Array) -> tuple[Array, Array, Array]:
        """Next states (..., 3), their derivatives by x, (..., 3, 3), and by w, (..., 3, nw)."""
        body = w @ self.motion
        ahead, left, turned = body[..., 0], body[..., 1], body[..., 2]
        terms = []
        for node, weight in self.nodes:
            angle = x[..., 2] + node * turned
            cos, sin = np.cos(angle), np.sin(angle)
            if weight != 1.0:
                cos, sin = weight * cos, weight * sin
            dx, dy = ahead * cos - left * sin, ahead * sin + left * cos
            # the last two: by the turn that leads to the node
            terms.append((cos, sin, dx, dy, -node * dy, node * dx))
        cos, sin, dx, dy, dx_by_turn, dy_by_turn = (
            reduce(np.add, parts) for parts in zip(*terms, strict=True)
        )
        by_x, by_body = np.empty((2, *w.shape[:-1], STATES, STATES))
        by_x[...] = by_body[...] = _IDENTITY
        by_body[..., 0, 0] = by_body[..., 1, 1] = cos
        by_body[..., 1, 0], by_body[..., 0, 1] = sin, -sin
        by_body[..., 0, 2], by_body[..., 1, 2] = dx_by_turn, dy_by_turn
        by_x[..., 0, 2], by_x[..., 1, 2] = -dy, dx
        value = x.copy()
        value[..., 0] += dx
        value[..., 1] += dy
        value[..., 2] += turned
        # one product of a tall matrix takes a fifth of the time of many small ones
        by_w = by_body.reshape(-1, STATES) @ self.motion.T
        return value, by_x, by_w.reshape(*by_body.shape[:-1], -1)

    def _displacements(self, headings: Array, body: Array) -> Array:
        """Where motions (..., 3) in the robot's frame lead from headings (...)."""
        ahead, left, turned = body[..., 0], body[..., 1], body[..., 2]
        cos: Array | float = 0.0
        sin: Array | float = 0.0
        for node, weight in self.nodes:
            angle = headings + node * turned
            cos, sin = cos + weight * np.cos(angle), sin + weight * np.sin(angle)
        return np.stack([ahead * cos - left * sin, ahead * sin + left * cos, turned], axis=-1)


def _lifts(dictionary: Dictionary, place: Trigonometry) -> bool:
    """Whether a dictionary lifts as the names of its coordinates say."""
    lifted, heading = dictionary.lift(_SOMEWHERE).tolist(), float(_SOMEWHERE[2])
    found = [lifted[i] for i in place]
    told = 1.0, math.cos(heading), math.sin(heading)
    return bool(max(abs(f - t) for f, t in zip(found, told, strict=True)) <= ROUNDING)


_IDENTITY = np.eye(STATES)
_SOMEWHERE = np.array((0.3, -0.7, 1.1))  # a pose whose coordinates tell all liftings apart
