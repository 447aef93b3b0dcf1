"""The paper's minimal dictionary."""

from __future__ import annotations

import numpy as np

from kmpc_lite.model.dictionary.base import AnyWheels
from kmpc_lite.types import Array


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


_ONES = np.arange(4)
"""Diagonal of `UnicycleDictionary.expand`: one wherever the robot is."""
