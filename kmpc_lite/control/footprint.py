"""What a robot covers on the floor: a convex outline about its pose, and circles that cover it.

The pose may lie anywhere on it: at the rear axle, or beside the middle. Plans and checks keep the
circles off obstacles, all of one radius: they follow each other along the outline's longer side,
and stick out of it by a part of half its width.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.input_checks import scalar
from kmpc_lite.errors import ProblemError
from kmpc_lite.files import real_array
from kmpc_lite.types import Array

ROUNDING = 1e-9  # share of a length by which a point on a circle may seem to lie outside
KEYS = ("length", "width", "ahead")
LEAST_EDGE = 1e-6  # corners nearer to each other than this are one [m]
FARTHEST = 1e100  # squares of farther coordinates overflow [m]
BENT = 1e-9  # sine of a corner's turn that rounding may leave on a straight edge


@dataclass(frozen=True)
class Footprint:
    """A convex outline in the robot's frame: x ahead, y to the left, the pose at (0, 0).

    Parameters
    ----------
    corners : array_like
        (K, 2) in order, either way around, K >= 3 [m].
    excess : float
        By how much the radius of the circles may exceed half its width, as a share of that: the
        fewest circles for which it does not are taken, `most_circles` at the most.
    most_circles : int
        From 1 to 9.

    Raises
    ------
    ProblemError
        For fewer than three corners or too many, an outline that is not convex or has no area, or
        values that are not finite.

    Examples
    --------
    >>> cart = Footprint.rectangle(1.0, 0.5, ahead=-0.25)
    >>> cart.corners
    ((-0.25, -0.25), (0.75, -0.25), (0.75, 0.25), (-0.25, 0.25))
    >>> len(cart.circles), round(cart.circle_radius, 3), round(cart.radius, 3)
    (3, 0.3, 0.791)
    """

    corners: tuple[tuple[float, float], ...]
    """Counter-clockwise."""
    excess: float = 0.25
    most_circles: int = 5

    def __init__(self, corners: ArrayLike, excess: float = 0.25, most_circles: int = 5) -> None:
        scalar("footprint: excess", excess, above_zero=True)
        if most_circles not in range(1, 10):
            raise ProblemError(
                f"footprint: most_circles: expected a whole number from 1 to 9, "
                f"got {most_circles!r}"
            )
        outline = convex_outline(corners, "footprint", 32)
        object.__setattr__(self, "corners", outline)
        object.__setattr__(self, "excess", excess)
        object.__setattr__(self, "most_circles", most_circles)

    @classmethod
    def rectangle(cls, length: float, width: float, ahead: float = 0.0) -> Footprint:
        """Rectangle whose middle is not always the pose.

        Parameters
        ----------
        length, width : float
            Along the robot and across it [m].
        ahead : float
            How far the pose lies ahead of the middle [m]; below zero: behind it, as at a rear axle.
        """
        scalar("footprint: length", length, above_zero=True)
        scalar("footprint: width", width, above_zero=True)
        scalar("footprint: ahead", abs(ahead) if isinstance(ahead, float | int) else ahead, False)
        back, front, side = -0.5 * length - ahead, 0.5 * length - ahead, 0.5 * width
        return cls([(back, -side), (front, -side), (front, side), (back, side)])

    @classmethod
    def of(cls, value: Any) -> Footprint:
        """Read what a file says: a table of length, width and ahead, or a list of corners."""
        if not isinstance(value, Mapping):
            return cls(value)
        if not {"length", "width"} <= set(value) <= set(KEYS):
            raise ProblemError(
                "footprint: expected corners [[x, y], ...], or a table of length, width and, where "
                f"the pose is not the middle, ahead; got {dict(value)!r:.80}"
            )
        return cls.rectangle(**value)

    def scaled(self, unit: float) -> Footprint:
        """Return the same in units of a length [m]."""
        if unit == 1.0:
            return self
        other = copy(self)
        for name in ("_cover", "outline", "core_radius", "is_covered_closely"):
            other.__dict__.pop(name, None)
        corners = tuple((x / unit, y / unit) for x, y in self.corners)
        object.__setattr__(other, "corners", corners)
        return other

    @cached_property
    def outline(self) -> Array:
        """Corners (K, 2) [m]."""
        return np.array(self.corners)

    @property
    def radius(self) -> float:
        """Of the circle about the pose that the outline lies in: it turns on the spot in it [m]."""
        return float(np.hypot(*self.outline.T).max())

    @property
    def inner_radius(self) -> float:
        """Of the largest circle about the pose that lies in the outline; 0 for a pose outside."""
        return float(self._inner_radii(np.zeros((1, 2)))[0])

    @cached_property
    def core_radius(self) -> float:
        """Of circles about the middles of those that cover it, all of which lie in it [m]."""
        return float(self._inner_radii(self.circles).min())

    @cached_property
    def is_covered_closely(self) -> bool:
        """Whether the circles stick out of its sides no farther than `excess` says."""
        narrowest = _longer_side(self.outline)[1]
        return self.circle_radius <= 0.5 * narrowest * (1.0 + self.excess) * (1.0 + ROUNDING)

    def _inner_radii(self, points: Array) -> Array:
        """Radii (n,) of the largest circles about points (n, 2) that lie in the outline [m]."""
        edges = np.roll(self.outline, -1, axis=0) - self.outline
        outward = np.stack([edges[:, 1], -edges[:, 0]], axis=1) / np.hypot(*edges.T)[:, None]
        depth = (outward * self.outline).sum(axis=1) - points @ outward.T
        return np.asarray(np.maximum(depth.min(axis=1), 0.0))

    @property
    def circles(self) -> Array:
        """Middles (C, 2) of the circles that cover it, as seen from the pose [m]."""
        return self._cover[0]

    @property
    def circle_radius(self) -> float:
        """Radius of each of them [m]."""
        return self._cover[1]

    @property
    def half_width(self) -> float:
        """How far the circles reach aside of the line on which the pose drives [m]."""
        return float(np.abs(self.circles[:, 1]).max()) + self.circle_radius

    @property
    def reach(self) -> float:
        """How far the middle of a circle lies from the pose at the most [m]."""
        return float(np.hypot(*self.circles.T).max())

    def places(self, poses: Array) -> Array:
        """Middles (..., C, 2) of the circles of a robot at poses (..., 3) [m, m, rad]."""
        x, y = self.circles.T
        cos, sin = np.cos(poses[..., 2:]), np.sin(poses[..., 2:])
        return np.stack(
            [poses[..., :1] + cos * x - sin * y, poses[..., 1:2] + sin * x + cos * y], axis=-1
        )

    def at(self, pose: ArrayLike) -> Array:
        """Corners (K, 2) of the outline of a robot at a pose (3,) [m, m, rad]."""
        x, y, heading = np.asarray(pose, dtype=float)
        cos, sin = np.cos(heading), np.sin(heading)
        turned: Array = self.outline @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
        return turned

    @cached_property
    def _cover(self) -> tuple[Array, float]:
        """Middles (C, 2) and radius of the fewest circles that cover it closely enough [m]."""
        along, width = _longer_side(self.outline)
        enough = 0.5 * width * (1.0 + self.excess)
        for count in range(1, self.most_circles + 1):
            found = [_around(part) for part in _slices(self.outline, along, count)]
            radius = max(circle[2] for circle in found)
            if radius <= enough:
                break
        return np.array([circle[:2] for circle in found]), radius


def places_of(footprint: Footprint | None, poses: Array) -> Array:
    """Places (n C, 2) that are kept off obstacles at poses (..., 3), n in all [m].

    Those of a footprint's circles, pose by pose; of a round robot the poses' own.
    """
    if footprint is None:
        return poses[..., :2].reshape(-1, 2)
    return footprint.places(poses).reshape(-1, 2)


def _longer_side(outline: Array) -> tuple[Array, float]:
    """Direction (2,) across which an outline (K, 2) is narrowest, and how wide it is there [m]."""
    edges = np.roll(outline, -1, axis=0) - outline
    edges /= np.hypot(*edges.T)[:, None]
    widths = np.ptp(outline @ np.stack([-edges[:, 1], edges[:, 0]]), axis=0)
    narrowest = int(widths.argmin())
    return edges[narrowest], float(widths[narrowest])


def _slices(outline: Array, along: Array, count: int) -> list[Array]:
    """Corners (k, 2) of the equally long parts that an outline (K, 2) is cut into across `along`.

    They share the points of the cuts.
    """
    place, begin = outline @ along, outline
    end, end_place = np.roll(outline, -1, axis=0), np.roll(place, -1)
    cuts = np.linspace(place.min(), place.max(), count + 1)
    met = []
    for cut in cuts[1:-1]:
        crosses = (place - cut) * (end_place - cut) < 0.0
        share = (cut - place[crosses]) / (end_place - place)[crosses]
        met.append(begin[crosses] + share[:, None] * (end - begin)[crosses])
    slack = ROUNDING * (cuts[-1] - cuts[0])
    parts = []
    for k in range(count):
        inside = (place >= cuts[k] - slack) & (place <= cuts[k + 1] + slack)
        parts.append(np.concatenate([outline[inside], *met[max(k - 1, 0) : k + 1]]))
    return parts


def _around(points: Array) -> tuple[float, float, float]:
    """Smallest circle around points (k, 2): x, y, radius.

    It passes through two of them that lie opposite each other on it, or through three.
    """
    pairs = np.array(list(combinations(range(len(points)), 2)))
    middles = [points[pairs].mean(axis=1)]
    if len(points) > 2:
        first, second, third = points[np.array(list(combinations(range(len(points)), 3)))].swapaxes(
            0, 1
        )
        b, c = second - first, third - first
        twice = 2.0 * (b[:, 0] * c[:, 1] - b[:, 1] * c[:, 0])
        flat = np.abs(twice) < ROUNDING * np.maximum((b * b).sum(axis=1), (c * c).sum(axis=1))
        b2, c2 = (b * b).sum(axis=1), (c * c).sum(axis=1)
        centre = np.stack([c[:, 1] * b2 - b[:, 1] * c2, b[:, 0] * c2 - c[:, 0] * b2], axis=1)
        middles.append((first + centre / np.where(flat, 1.0, twice)[:, None])[~flat])
    candidates = np.concatenate(middles)
    # about a middle that is given, the farthest point says how large the circle must be
    radii = np.hypot(*(candidates[:, None] - points).transpose(2, 0, 1)).max(axis=1)
    best = int(radii.argmin())
    x, y = candidates[best].tolist()
    return x, y, float(radii[best])


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
