"""Convex outlines: of obstacles, and of robots."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ProblemError
from kmpc_lite.files import real_array
from kmpc_lite.types import Array

LEAST_EDGE = 1e-6
"""Corners nearer to each other than this are one [m]."""
FARTHEST = 1e100
"""Squares of farther coordinates overflow [m]."""
BENT = 1e-9
"""Sine of a corner's turn that rounding may leave on a straight edge."""


def convex_outline(
    vertices: ArrayLike, what: str, most_corners: int
) -> tuple[tuple[float, float], ...]:
    """Check corners (K, 2) of a convex outline [m], and give them counter-clockwise.

    `vertices`: in order, either way around. `what`: what they are the corners of, for errors.
    `most_corners`: how many it may have. Raises ProblemError for fewer than three corners or too
    many, an outline that is not convex or has no area, or values that are not finite.
    """
    corners = real_array(vertices, what, ProblemError)
    if corners.ndim != 2 or corners.shape[1] != 2 or len(corners) < 3:
        raise ProblemError(f"{what}: expected at least 3 corners (K, 2), got shape {corners.shape}")
    if len(corners) > most_corners:
        raise ProblemError(f"{what}: expected at most {most_corners} corners, got {len(corners)}")
    if not (np.abs(corners) <= FARTHEST).all():
        raise ProblemError(f"{what}: expected finite corners, got {corners.tolist()}")
    if _area(corners) < 0.0:
        corners = corners[::-1]
    edges = np.roll(corners, -1, axis=0) - corners
    lengths = np.hypot(edges[:, 0], edges[:, 1])
    if lengths.min() < LEAST_EDGE:
        raise ProblemError(
            f"{what}: corner {int(lengths.argmin())} is there twice: {corners.tolist()}"
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
            f"{what}: expected a convex outline with an area, got {corners.tolist()}; "
            "cut it into convex ones"
        )
    return tuple((float(x), float(y)) for x, y in corners)


def _area(corners: Array) -> float:
    """Signed area of an outline (K, 2) [m^2], positive counter-clockwise."""
    # about its own middle, so that nothing is lost far from the origin
    x, y = (corners - corners.mean(axis=0)).T
    return 0.5 * float(x @ np.roll(y, -1) - y @ np.roll(x, -1))
