"""Obstacles with straight edges: convex polygons, and walls."""

from __future__ import annotations

from copy import copy
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.options.obstacles import USUAL_OBSTACLES, ObstacleOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.files import real_array
from kmpc_lite.types import Array

LEAST_EDGE = 1e-6
"""Corners nearer to each other than this are one [m]."""
FARTHEST = 1e100
"""Squares of farther coordinates overflow [m]."""
BENT = 1e-9
"""Sine of a corner's turn that rounding may leave on a straight edge."""


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
        corners = real_array(vertices, "polygon", ProblemError)
        if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
            raise ProblemError(
                f"polygon: expected at least 3 corners (K, 2), got shape {corners.shape}"
            )
        if len(corners) > limits.polygon_corners:
            raise ProblemError(
                f"polygon: expected at most {limits.polygon_corners} corners, got {len(corners)}"
            )
        if not (np.abs(corners) <= FARTHEST).all():
            raise ProblemError(f"polygon: expected finite corners, got {corners.tolist()}")
        if _area(corners) < 0.0:
            corners = corners[::-1]
        edges = np.roll(corners, -1, axis=0) - corners
        lengths = np.hypot(edges[:, 0], edges[:, 1])
        if lengths.min() < LEAST_EDGE:
            raise ProblemError(
                f"polygon: corner {int(lengths.argmin())} is there twice: {corners.tolist()}"
            )
        after = np.roll(edges, -1, axis=0)
        sine = (edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]) / (
            lengths * np.roll(lengths, -1)
        )
        cosine = (edges * after).sum(axis=1) / (lengths * np.roll(lengths, -1))
        # a star turns left at every corner too, but more than once around
        turned = float(np.arctan2(sine, cosine).sum())
        if sine.min() < -BENT or turned > 3 * np.pi or _area(corners) < LEAST_EDGE**2:
            raise ProblemError(
                f"polygon: expected a convex outline with an area, got {corners.tolist()}; "
                "cut it into convex ones"
            )
        object.__setattr__(self, "vertices", tuple((float(x), float(y)) for x, y in corners))

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


def _area(corners: Array) -> float:
    """Signed area of an outline (K, 2) [m^2], positive counter-clockwise."""
    # about its own middle, so that nothing is lost far from the origin
    x, y = (corners - corners.mean(axis=0)).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
