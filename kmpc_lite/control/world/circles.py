"""Circles: what a user gives, as rows of an array, and distances from them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

COLUMNS = 5


class _CircleFields(NamedTuple):
    x: float
    y: float
    radius: float
    vx: float
    vy: float


class Circle(_CircleFields):
    """A round obstacle, moving at constant velocity.

    Parameters
    ----------
    x, y : float
        Centre [m].
    radius : float
        >= 0 [m].
    vx, vy : float
        Velocity [m/s].

    Raises
    ------
    ProblemError
        For a negative radius, or values that are not finite.

    Examples
    --------
    >>> Circle(0.5, 0.5, 0.15)
    Circle(x=0.5, y=0.5, radius=0.15, vx=0.0, vy=0.0)
    """

    __slots__ = ()

    def __new__(cls, x: float, y: float, radius: float, vx: float = 0.0, vy: float = 0.0) -> Circle:
        """Check and make a circle."""
        values = (float(x), float(y), float(radius), float(vx), float(vy))
        if not np.isfinite(values).all():
            raise ProblemError(f"circle: expected finite numbers, got {values}")
        if values[2] < 0.0:
            raise ProblemError(
                f"circle at ({values[0]:g}, {values[1]:g}): expected a radius >= 0 m, "
                f"got {values[2]:g}"
            )
        return super().__new__(cls, *values)


def circles_to_array(obstacles: Sequence[Circle] | ArrayLike) -> Array:
    """Rows x, y, radius, vx, vy, (M, 5), from circles or from an array (M, 3) or (M, 5).

    Raises ValueError for other shapes. Values are not looked at: what arrives while driving must
    not raise.
    """
    if isinstance(obstacles, Sequence) and not len(obstacles):
        return np.empty((0, COLUMNS))
    try:
        array = np.asarray(obstacles, dtype=float)
    except TypeError as error:
        raise ValueError(f"obstacles: expected circles or an array of them: {error}") from error
    if array.ndim == 2 and array.shape[1] == 3:
        array = np.hstack([array, np.zeros((len(array), 2))])
    if array.ndim != 2 or array.shape[1] != COLUMNS:
        raise ValueError(
            f"obstacles: expected circles, or an array (M, 3) or (M, {COLUMNS}) of x, y, radius, "
            f"vx, vy; got shape {array.shape}"
        )
    return array
