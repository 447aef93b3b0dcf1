"""Obstacles, and the distances and normals that the QP needs of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.dictionary import Array
from kmpc_lite.errors import ProblemError

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
            raise ProblemError(f"circle at ({values[0]:g}, {values[1]:g}): expected a radius >= 0 m, got {values[2]:g}")
        return super().__new__(cls, *values)


def circles_to_array(obstacles: Sequence[Circle] | ArrayLike) -> Array:
    """Rows x, y, radius, vx, vy, (M, 5), from circles or from an array (M, 3) or (M, 5).

    Raises
    ------
    ValueError
        For other shapes. Values are not looked at: what arrives while driving must not raise.
    """
    if isinstance(obstacles, Sequence) and not len(obstacles):
        return np.empty((0, COLUMNS))
    array = np.asarray(obstacles, dtype=float)
    if array.ndim == 2 and array.shape[1] == 3:
        array = np.hstack([array, np.zeros((len(array), 2))])
    if array.ndim != 2 or array.shape[1] != COLUMNS:
        raise ValueError(
            f"obstacles: expected circles, or an array (M, 3) or (M, {COLUMNS}) of x, y, radius, vx, vy; got shape {array.shape}"
        )
    return array


def circle_distances(circles: Array, positions: Array, times: Array) -> tuple[Array, Array]:
    """Distances to the circles' edges and the directions away from them.

    Parameters
    ----------
    circles : ndarray
        (M, 5).
    positions, times : ndarray
        (n, 2) [m] and (n,) [s], from now.

    Returns
    -------
    distances, normals : ndarray
        (n, M) [m], negative inside, and (n, M, 2); a normal at a centre is arbitrary.
    """
    away = positions[:, None, :] - circles[:, :2] - times[:, None, None] * circles[:, 3:]
    length = np.sqrt(np.einsum("nmi,nmi->nm", away, away))
    at_centre = length < 1e-9
    if at_centre.any():
        away[at_centre] = (1e-9, 0.0)
        length[at_centre] = 1e-9
    return length - circles[:, 2], away / length[..., None]


class Boundary:
    """The four sides of the area, as distances of the robot's centre to half-planes.

    A robot that stands outside widens its side to where it stands: it is asked to come back, at no
    obstacle's expense.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        _, _, x_min, x_max = problem.bounds
        sides = [(axis, sign, bound) for axis in (0, 1) for sign, bound in ((1.0, x_min[axis]), (-1.0, x_max[axis])) if np.isfinite(bound)]
        self.normals = np.array([[sign if axis == i else 0.0 for i in (0, 1)] for axis, sign, _ in sides]).reshape(-1, 2)
        self.offsets = np.array([sign * bound for _, sign, bound in sides])

    def distances(self, positions: Array, present: Array) -> Array:
        """Distances (n, sides) [m] of positions (n, 2), for a robot that is at `present` (2,)."""
        offsets = np.minimum(self.offsets, self.normals @ present)
        distances: Array = positions @ self.normals.T - offsets
        return distances
