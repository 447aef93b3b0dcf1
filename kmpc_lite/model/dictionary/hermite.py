"""The paper's dictionaries: unicycle, and Hermite polynomials times trigonometric functions."""

from __future__ import annotations

from itertools import product
from math import comb
from typing import Any

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.model.dictionary.base import MAX_SIZE, AnyWheels
from kmpc_lite.types import INPUTS, Array

_ONES = np.arange(4)  # diagonal of `UnicycleDictionary.expand`: one wherever the robot is


class UnicycleDictionary(AnyWheels):
    """The paper's minimal dictionary, ``[1, x, y, theta, cos theta, sin theta]`` (sec. IV).

    Parameters
    ----------
    commands : int
        Numbers of a command: 2, or 3 of a robot that drives sideways, too.

    Examples
    --------
    >>> UnicycleDictionary().lift(np.array([1.0, 2.0, 0.0]))
    array([1., 1., 2., 0., 1., 0.])
    """

    kind = "unicycle"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the six lifted coordinates."""
        return ("1", "x", "y", "theta", "cos", "sin")

    @property
    def size(self) -> int:
        """Six."""
        return 6

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., 6)."""
        # poses of whole numbers too must come out as floats; symbolic ones stay objects
        z = np.empty((*x.shape[:-1], 6), dtype=np.result_type(x, np.float64))
        z[..., 0] = 1.0
        z[..., 1:4] = x
        z[..., 4] = np.cos(x[..., 2])
        z[..., 5] = np.sin(x[..., 2])
        return z

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift`: (..., 6, 3)."""
        return self.expand(x)[..., 1:]

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side, (..., 6, 4)."""
        both = np.zeros((*x.shape[:-1], 6, 4))
        both[..., _ONES, _ONES] = 1.0
        both[..., 1:4, 0] = x
        cos, sin = np.cos(x[..., 2]), np.sin(x[..., 2])
        both[..., 4, 0] = both[..., 5, 3] = cos
        both[..., 5, 0] = sin
        both[..., 4, 3] = -sin
        return both


class HermiteTrigDictionary(AnyWheels):
    """Hermite polynomials of the pose times trigonometric functions of the heading (ACD-EDMD).

    All products ``He_i(x) He_j(y) He_k(theta) * {1, cos(m theta), sin(m theta)}`` with
    ``i + j + k <= order`` and ``m <= harmonics`` (Shi & Karydis 2021, probabilists' polynomials).
    Order 0 with one harmonic is ``[1, cos, sin]``: a model that does not depend on where the robot
    is, the right one for logs from a real floor.

    Parameters
    ----------
    order : int
        Highest total degree of the polynomials, >= 0.
    harmonics : int
        Highest multiple of the heading, >= 0.
    commands : int
        Numbers of a command: 2, or 3 of a robot that drives sideways, too.

    Examples
    --------
    >>> HermiteTrigDictionary(order=0).names
    ('1', 'cos(theta)', 'sin(theta)')
    >>> HermiteTrigDictionary(order=1).size
    12
    """

    kind = "hermite_trig"

    def __init__(self, order: int = 1, harmonics: int = 1, commands: int = INPUTS) -> None:
        super().__init__(commands)
        if not (
            0 <= order <= MAX_SIZE
            and 0 <= harmonics <= MAX_SIZE
            and order == int(order)
            and harmonics == int(harmonics)
        ):
            raise ModelError(
                f"HermiteTrigDictionary: order and harmonics must be integers >= 0, got {order}, "
                f"{harmonics}"
            )
        self.order, self.harmonics = int(order), int(harmonics)
        size = comb(self.order + 3, 3) * (2 * self.harmonics + 1)
        if size > MAX_SIZE:
            raise ModelError(
                f"HermiteTrigDictionary: order {order} and harmonics {harmonics} give {size:,} "
                f"coordinates, at most {MAX_SIZE:,}"
            )
        self._multiples = np.arange(1, self.harmonics + 1)
        degrees = [d for d in product(range(self.order + 1), repeat=3) if sum(d) <= self.order]
        self._degrees = np.array(sorted(degrees, key=lambda d: (sum(d), tuple(-i for i in d))))
        trig = ["1"] + [
            f"{f}({m if m > 1 else ''}theta)"
            for m in range(1, self.harmonics + 1)
            for f in ("cos", "sin")
        ]
        poly = [
            "*".join(f"He{i}({s})" for i, s in zip(d, ("x", "y", "theta"), strict=True) if i)
            for d in self._degrees
        ]
        self._names = tuple(
            "*".join(p for p in (a, b if b != "1" or not a else "") if p)
            for a in poly
            for b in trig
        )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the lifted coordinates."""
        return self._names

    def _trigonometric(self, x: Array) -> Array:
        """Give [1, cos theta, sin theta, cos 2 theta, ...] (..., 2 harmonics + 1)."""
        trig = np.ones((*x.shape[:-1], 2 * self.harmonics + 1), dtype=np.result_type(x, np.float64))
        for m in range(1, self.harmonics + 1):
            angle = x[..., 2] if m == 1 else m * x[..., 2]
            trig[..., 2 * m - 1] = np.cos(angle)
            trig[..., 2 * m] = np.sin(angle)
        return trig

    def _trigonometric_slope(self, trig: Array) -> Array:
        """Differentiate `_trigonometric` by the heading."""
        slope = np.zeros_like(trig)
        slope[..., 1::2] = -self._multiples * trig[..., 2::2]
        slope[..., 2::2] = self._multiples * trig[..., 1::2]
        return slope

    def _polynomials(self, x: Array) -> Array:
        """Give He_n of each coordinate, (..., 3, order + 1)."""
        he = np.ones((*x.shape, self.order + 1), dtype=np.result_type(x, np.float64))
        for n in range(1, self.order + 1):
            he[..., n] = x * he[..., n - 1] - ((n - 1) * he[..., n - 2] if n > 1 else 0.0)
        return he

    def lift(self, x: Array) -> Array:
        """Lift states (..., 3) to (..., nz)."""
        trig = self._trigonometric(x)
        if self.order == 0:
            return trig
        he, d = self._polynomials(x), self._degrees
        poly = he[..., 0, d[:, 0]] * he[..., 1, d[:, 1]] * he[..., 2, d[:, 2]]
        z: Array = (poly[..., :, None] * trig[..., None, :]).reshape(*x.shape[:-1], self.size)
        return z

    def jacobian(self, x: Array) -> Array:
        """Differentiate `lift`: (..., nz, 3), with ``He_n' = n He_(n-1)``."""
        return self.expand(x)[..., 1:]

    def expand(self, x: Array) -> Array:
        """Give `lift` and `jacobian` side by side, (..., nz, 4)."""
        trig = self._trigonometric(x)
        trig_slope = self._trigonometric_slope(trig)
        if self.order == 0:
            both = np.zeros((*trig.shape, 4))
            both[..., 0] = trig
            both[..., 3] = trig_slope
            return both
        he, d = self._polynomials(x), self._degrees
        slope = np.zeros_like(he)
        slope[..., 1:] = np.arange(1, self.order + 1) * he[..., :-1]
        value = [he[..., i, d[:, i]] for i in range(3)]
        gradient = [slope[..., i, d[:, i]] for i in range(3)]
        poly = value[0] * value[1] * value[2]
        by_pose = [
            poly,
            gradient[0] * value[1] * value[2],
            value[0] * gradient[1] * value[2],
            value[0] * value[1] * gradient[2],
        ]
        by_all: Array = np.stack(by_pose, axis=-1)[..., :, None, :] * trig[..., None, :, None]
        by_all[..., 3] += poly[..., :, None] * trig_slope[..., None, :]
        return by_all.reshape(*x.shape[:-1], self.size, 4)

    def config(self) -> dict[str, Any]:
        """Give the constructor's arguments."""
        return {"order": self.order, "harmonics": self.harmonics, **super().config()}
