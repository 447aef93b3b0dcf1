"""What paths are made of: free common tangents of circles, and free arcs between these."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from operator import itemgetter
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.path.cuts import edge_bars, free_of_edges
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.lattice_path import LatticePath

TURNING = 4
"""Number of circles to turn on: left and right of the start, left and right of the goal."""
ROUNDING = 1e-7
"""How deep a line may cut a circle [m], since lines touch circles."""
PORTION = 2**17
"""Tangents times obstacles that are looked at at once: a matter of memory, which changes nothing of
what is found."""
FIRST_SENSE = np.array([1.0, 1.0, -1.0, -1.0])
SECOND_SENSE = np.array([1.0, -1.0, 1.0, -1.0])
"""Sense of rotation (1: counter-clockwise) at the first and the second circle of the four tangents
of two circles."""


@dataclass(slots=True)
class Circles:
    """All that a path of one search may touch."""

    points: Array
    """(C, 2) centres [m]: obstacles, then the `TURNING` circles, then start and goal."""
    sizes: Array
    """(C,) radii [m]; those of start and goal are zero."""
    count: int
    """How many are obstacles."""
    edges: Array
    """(S, 2) numbers of obstacles of one radius, between which no path may pass."""
    area: Array
    """(4,) xmin, ymin, xmax, ymax that lines and arcs must not leave [m]."""


class Tangents(NamedTuple):
    """Common tangents of two circles each."""

    first: Array
    """(T,) numbers of the circles where they begin."""
    second: Array
    """(T,) numbers of the circles where they end."""
    senses: Array
    """(T, 2) rotation about both circles along the tangent: 1 is counter-clockwise."""
    ends: Array
    """(T, 2, 2) the two points that they join [m]."""
    directions: Array
    """(T, 2) unit vectors."""
    lengths: Array
    """(T,) [m]."""

    def take(self, chosen: Array | slice) -> Tangents:
        """Some of them."""
        return Tangents(*map(itemgetter(chosen), self))


@lru_cache(maxsize=64)
def _pairs(count: int) -> tuple[Array, Array, Array]:
    """Pairs of circles (P,), (P,), and which of their four tangents make sense (P, 4)."""
    first, second = np.triu_indices(count + TURNING + 2, 1)
    sensible = np.ones((len(first), 4), dtype=bool)
    # a point has no sense of rotation: keep one of two equal lines
    sensible[first >= count + TURNING, 2:] = False
    sensible[second >= count + TURNING, 1::2] = False
    # nothing joins what belongs to one pose
    group = np.concatenate([np.arange(count), np.repeat((count, count + 1), 2), (count, count + 1)])
    sensible[group[first] == group[second]] = False
    return first, second, sensible


def free_tangents(circles: Circles, lattice_path: LatticePath | None) -> Tangents:
    """Tangents that stay in the area and cut no obstacle."""
    tangents = _all_tangents(circles)
    free = np.zeros(len(tangents.first), dtype=bool)
    # in portions, so that no array is larger than the second-level cache by much
    portion = max(PORTION // (1 + circles.count + len(circles.edges)), 1)
    for begin in range(0, len(free), portion):
        some = slice(begin, begin + portion)
        free[some] = _free(tangents.take(some), circles, lattice_path)
    return tangents.take(free)


def _free(tangents: Tangents, circles: Circles, lattice_path: LatticePath | None) -> Array:
    """Which of some tangents (T,) stay in the area and cut no obstacle."""
    within = (tangents.ends >= circles.area[:2] - ROUNDING) & (
        tangents.ends <= circles.area[2:] + ROUNDING
    )
    free: Array = np.all(within, axis=(1, 2))
    if circles.count:
        # most end inside another obstacle, which is seen faster
        look = np.flatnonzero(free)
        free[look] = _ends_free_of_circles(tangents.ends[look], circles)
        look = np.flatnonzero(free)
        free[look] = _free_of_circles(tangents, look, circles)
    ends = tangents.ends
    if len(circles.edges):
        look, (begin, end) = np.flatnonzero(free), circles.edges.T
        free[look] = free_of_edges(
            ends[look, 0],
            ends[look, 1],
            circles.points[begin],
            circles.points[end],
            np.maximum(circles.sizes[begin] - ROUNDING, 0.0),
        )
    if lattice_path is not None:
        look = np.flatnonzero(free)
        free[look] = lattice_path.lines_free(ends[look, 0], ends[look, 1])
    return free


def _all_tangents(circles: Circles) -> Tangents:
    """All common tangents that make sense, whatever they cut."""
    points, sizes = circles.points, circles.sizes
    first, second, sensible = _pairs(circles.count)
    offset = points[second] - points[first]
    distance = np.sqrt(np.einsum("pi,pi->p", offset, offset)) + 1e-12
    along = offset / distance[:, None]
    # cosine between the line of centres and the tangent's right-hand normal
    difference = sizes[first, None] * FIRST_SENSE - sizes[second, None] * SECOND_SENSE
    cosine = difference / distance[:, None]
    pair, kind = np.nonzero(sensible & (np.abs(cosine) < 1.0))
    cosine = cosine[pair, kind]
    sine = -np.sqrt(1.0 - cosine * cosine)
    along = along[pair]
    normal = cosine[:, None] * along
    normal[:, 0] -= sine * along[:, 1]
    normal[:, 1] += sine * along[:, 0]
    first, second = first[pair], second[pair]
    senses = np.stack([FIRST_SENSE[kind], SECOND_SENSE[kind]], axis=1)
    ends = np.stack([points[first], points[second]], axis=1)
    ends[:, 0] += (senses[:, 0] * sizes[first])[:, None] * normal
    ends[:, 1] += (senses[:, 1] * sizes[second])[:, None] * normal
    directions = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    lengths = np.einsum("ti,ti->t", ends[:, 1] - ends[:, 0], directions)
    return Tangents(first, second, senses, ends, directions, lengths)


def _ends_free_of_circles(ends: Array, circles: Circles) -> Array:
    """Which tangents (L,) have both ends (L, 2, 2) outside all obstacles."""
    centres = circles.points[: circles.count]
    squares = np.maximum(circles.sizes[: circles.count] - ROUNDING, 0.0) ** 2
    x = ends[..., 0].reshape(-1, 1) - centres[:, 0]
    y = ends[..., 1].reshape(-1, 1) - centres[:, 1]
    x *= x
    y *= y
    x += y
    outside = x.reshape(-1, 2, circles.count) >= squares
    free: Array = np.all(outside, axis=(1, 2))
    return free


def _free_of_circles(tangents: Tangents, look: Array, circles: Circles) -> Array:
    """Which of some tangents (L,) cut none of the obstacles but their own two."""
    count = circles.count
    centres = circles.points[:count]
    squares = np.maximum(circles.sizes[:count] - ROUNDING, 0.0) ** 2
    directions, begins = tangents.directions[look], tangents.ends[look, :1]
    # squared distance of every centre to every line
    away = centres - begins
    along = np.einsum("tmi,ti->tm", away, directions)
    nearest = np.clip(along, 0.0, tangents.lengths[look, None])
    away -= nearest[..., None] * directions[:, None]
    beyond = np.einsum("tmi,tmi->tm", away, away) - squares
    for own in (tangents.first[look], tangents.second[look]):
        is_obstacle = own < count
        beyond[np.flatnonzero(is_obstacle), own[is_obstacle]] = 0.0
    free: Array = beyond.min(axis=1) >= 0.0
    return free


def free_arcs(
    circles: Circles, circle: Array, rotation: Array, places: Array
) -> tuple[Array, Array, Array]:
    """Arcs from a node to the next one of its circle and sense, but for those that something bars.

    Parameters
    ----------
    circles : Circles
        Of the search.
    circle, rotation : ndarray
        (n,) number of each node's circle, and the sense of rotation about it.
    places : ndarray
        (n, 2) where the nodes are [m].

    Returns
    -------
    tails, heads, turns : ndarray
        (E,) nodes, (E,) nodes, and (E,) angles between them [rad].
    """
    total = circles.count + TURNING
    nodes = np.flatnonzero(circle < total)
    owner, sense = circle[nodes], rotation[nodes]
    away = places[nodes] - circles.points[owner]
    angle = np.arctan2(away[:, 1], away[:, 0])
    covered, bars = _bars(circles)
    # a bar takes its place among the nodes of both senses; no arc leads to it, or on from it
    number = np.concatenate([nodes, np.full(2 * len(bars), -1)])
    owner = np.concatenate([owner, covered, covered])
    sense = np.concatenate([sense, np.ones(len(bars)), -np.ones(len(bars))])
    turned = (sense * np.concatenate([angle, bars, bars])) % (2 * np.pi)
    layer = 2 * owner + (sense > 0)
    order = np.lexsort((turned, layer))
    number, layer, turned = number[order], layer[order], turned[order]
    # the one after the last of a layer is its first
    following = np.arange(1, len(number) + 1)
    is_last = np.append(layer[1:] != layer[:-1], True)
    following[is_last] = np.concatenate([[0], np.flatnonzero(is_last)[:-1] + 1])
    turn = (turned[following] - turned) % (2 * np.pi)
    use = (number >= 0) & (number[following] >= 0) & (number != number[following])
    return number[use], number[following][use], turn[use]


def _bars(circles: Circles) -> tuple[Array, Array]:
    """Bar the pieces of circles that something covers.

    Where another circle, a side of the area, or an edge covers a piece of a circle, its middle bars
    the arc: the numbers of the circles (B,), and the angles of the middles (B,).
    """
    total, count = circles.count + TURNING, circles.count
    centres, own = circles.points[:total], circles.sizes[:total, None]
    offset = circles.points[None, :count] - centres[:, None]
    distance = np.sqrt(np.einsum("mki,mki->mk", offset, offset))
    np.fill_diagonal(distance, np.inf)
    others = circles.sizes[:count]
    covered, by = np.nonzero((distance < own + others) & (distance > others - own))
    bars = np.arctan2(offset[covered, by, 1], offset[covered, by, 0])
    to_sides = np.concatenate([centres - circles.area[:2], circles.area[2:] - centres], axis=1)
    beyond, side = np.nonzero(to_sides < own)
    bars = np.concatenate([bars, np.array([np.pi, -np.pi / 2, 0.0, np.pi / 2])[side]])
    covered = np.concatenate([covered, beyond])
    if len(circles.edges):
        begin, end = circles.edges.T
        by_edges, angles = edge_bars(
            centres, own[:, 0], circles.points[begin], circles.points[end], circles.sizes[begin]
        )
        bars, covered = np.concatenate([bars, angles]), np.concatenate([covered, by_edges])
    return covered, bars
