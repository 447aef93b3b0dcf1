"""Obstacles as users give them: circles that move, convex polygons, walls."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.footprint import convex_outline
from kmpc_lite.control.options import USUAL_OBSTACLES, ObstacleOptions
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


@dataclass(frozen=True)
class Polygon:
    """A convex obstacle at rest.

    Parameters
    ----------
    vertices : array_like
        Corners (K, 2) in order, either way around, K >= 3 [m].
    limits : ObstacleOptions
        How many corners it may have.

    Raises
    ------
    ProblemError
        For fewer than three corners or too many, an outline that is not convex or has no area, or
        values that are not finite.

    Examples
    --------
    >>> Polygon([(0, 0), (0, 1), (1, 1)]).vertices
    ((1.0, 1.0), (0.0, 1.0), (0.0, 0.0))
    """

    vertices: tuple[tuple[float, float], ...]
    """Counter-clockwise."""

    def __init__(self, vertices: ArrayLike, limits: ObstacleOptions = USUAL_OBSTACLES) -> None:
        object.__setattr__(
            self, "vertices", convex_outline(vertices, "polygon", limits.polygon_corners)
        )

    def scaled(self, unit: float) -> Polygon:
        """Return the same in units of a length [m]."""
        other = copy(self)
        vertices = tuple((x / unit, y / unit) for x, y in self.vertices)
        object.__setattr__(other, "vertices", vertices)
        return other


@dataclass(frozen=True)
class Wall:
    """All within half its thickness of a straight line, so with round ends; at rest.

    Parameters
    ----------
    x1, y1, x2, y2 : float
        Ends [m]; they may be one point.
    thickness : float
        >= 0 [m].

    Raises
    ------
    ProblemError
        For a negative thickness, or values that are not finite.

    Examples
    --------
    >>> Wall(0.0, 0.0, 1.0, 0.0, thickness=0.1).length
    1.0
    """

    x1: float
    y1: float
    x2: float
    y2: float
    thickness: float = 0.0

    def __post_init__(self) -> None:
        names = [f.name for f in fields(self)]
        try:
            values = [float(getattr(self, name)) for name in names]
        except (TypeError, ValueError) as error:
            raise ProblemError(
                f"wall: expected numbers, got {[getattr(self, name) for name in names]}"
            ) from error
        if not np.isfinite(values).all():
            raise ProblemError(f"wall: expected finite numbers, got {values}")
        if values[4] < 0.0:
            raise ProblemError(
                f"wall from ({values[0]:g}, {values[1]:g}): "
                f"expected a thickness >= 0 m, got {values[4]:g}"
            )
        for name, value in zip(names, values, strict=True):
            object.__setattr__(self, name, value)

    def scaled(self, unit: float) -> Wall:
        """Return the same in units of a length [m]."""
        return Wall(*(getattr(self, f.name) / unit for f in fields(self)))

    @property
    def length(self) -> float:
        """Between its ends [m]."""
        return float(np.hypot(self.x2 - self.x1, self.y2 - self.y1))
