"""What ways are made of: the common tangents of circles, and the arcs between these, that nothing bars."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.guidance.edges import edge_bars, free_of_edges
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.guidance.lattice import LatticePath

TURNING = 4
"""Circles to turn on: left and right of the start, left and right of the goal."""
TOUCHING = 1e-7
"""How deep a line may cut a circle [m]: rounding, since lines touch circles."""
MANY = 20000
"""Tangents times circles from which on tangents are sorted out in two steps."""
FIRST_SENSE = np.array([1.0, 1.0, -1.0, -1.0])
SECOND_SENSE = np.array([1.0, -1.0, 1.0, -1.0])
"""Sense of rotation (1: counter-clockwise) at the first and the second circle of the four tangents
of two circles."""


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


def free_tangents(
    points: Array, sizes: Array, count: int, area: Array, edges: Array, route: LatticePath | None
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Free tangents: circles (T,), (T,), senses (T, 2), ends (T, 2, 2), directions (T, 2), lengths (T,)."""
    first, second, sensible = _pairs(count)
    offset = points[second] - points[first]
    distance = np.sqrt(np.einsum("pi,pi->p", offset, offset)) + 1e-12
    along = offset / distance[:, None]
    # cosine between the line of centres and the tangent's right-hand normal
    cosine = (sizes[first, None] * FIRST_SENSE - sizes[second, None] * SECOND_SENSE) / distance[
        :, None
    ]
    exists = sensible & (np.abs(cosine) < 1.0)
    pair, kind = np.nonzero(exists)
    cosine = cosine[pair, kind]
    sine = -np.sqrt(1.0 - cosine * cosine)
    along = along[pair]
    normal = cosine[:, None] * along
    normal[:, 0] -= sine * along[:, 1]
    normal[:, 1] += sine * along[:, 0]
    first, second = first[pair], second[pair]
    sense = np.stack([FIRST_SENSE[kind], SECOND_SENSE[kind]], axis=1)
    ends = np.stack([points[first], points[second]], axis=1)
    ends[:, 0] += (sense[:, 0] * sizes[first])[:, None] * normal
    ends[:, 1] += (sense[:, 1] * sizes[second])[:, None] * normal
    directions = np.stack([-normal[:, 1], normal[:, 0]], axis=1)
    lengths = np.einsum("ti,ti->t", ends[:, 1] - ends[:, 0], directions)

    inside: Array = (ends >= area[:2] - TOUCHING) & (ends <= area[2:] + TOUCHING)
    free: Array = np.all(inside, axis=(1, 2))
    if count:
        centres, square = points[:count], np.maximum(sizes[:count] - TOUCHING, 0.0) ** 2
        if len(first) * count > MANY:
            # most end inside another circle, which is seen faster
            flat = ends.reshape(-1, 2)
            gap = (
                np.einsum("ei,ei->e", flat, flat)[:, None]
                - 2.0 * flat @ centres.T
                + np.einsum("mi,mi->m", centres, centres)
                - square
            )
            free &= (gap >= -1e-12).all(axis=1).reshape(-1, 2).all(axis=1)
        look = np.flatnonzero(free)
        # squared distance of every centre to every line
        reach = centres - ends[look, :1]
        nearest = np.clip(
            np.einsum("tmi,ti->tm", reach, directions[look]), 0.0, lengths[look, None]
        )
        reach -= nearest[..., None] * directions[look, None]
        gap = np.einsum("tmi,tmi->tm", reach, reach) - square
        for own in (first[look], second[look]):
            is_circle = own < count
            gap[np.flatnonzero(is_circle), own[is_circle]] = 0.0
        free[look] = gap.min(axis=1) >= 0.0
    if len(edges):
        look, (begin, end) = np.flatnonzero(free), edges.T
        inflated = np.maximum(sizes[begin] - TOUCHING, 0.0)
        free[look] = free_of_edges(
            ends[look, 0], ends[look, 1], points[begin], points[end], inflated
        )
    if route is not None:
        look = np.flatnonzero(free)
        free[look] = route.lines_free(ends[look, 0], ends[look, 1])
    return first[free], second[free], sense[free], ends[free], directions[free], lengths[free]


def free_arcs(
    points: Array,
    sizes: Array,
    count: int,
    area: Array,
    circle: Array,
    rotation: Array,
    places: Array,
    edges: Array,
) -> tuple[Array, Array, Array]:
    """Free arcs from a node to the next one of its circle and sense: nodes (E,), (E,) and turns (E,) [rad]."""
    circles = count + TURNING
    nodes = np.flatnonzero(circle < circles)
    owner, sense = circle[nodes], rotation[nodes]
    away = places[nodes] - points[owner]
    angle = np.arctan2(away[:, 1], away[:, 0])
    # where another circle or a side of the area covers a piece of a circle, its middle bars the arc
    offset = points[None, :count] - points[:circles, None]
    distance = np.sqrt(np.einsum("mki,mki->mk", offset, offset))
    np.fill_diagonal(distance, np.inf)
    others = sizes[:count]
    own = sizes[:circles, None]
    covered, by = np.nonzero((distance < own + others) & (distance > others - own))
    bars = np.arctan2(offset[covered, by, 1], offset[covered, by, 0])
    beyond, side = np.nonzero(
        np.concatenate([points[:circles] - area[:2], area[2:] - points[:circles]], axis=1) < own
    )
    bars = np.concatenate([bars, np.array([np.pi, -np.pi / 2, 0.0, np.pi / 2])[side]])
    covered = np.concatenate([covered, beyond])
    if len(edges):
        begin, end = edges.T
        by_edges, angles = edge_bars(
            points[:circles], sizes[:circles], points[begin], points[end], sizes[begin]
        )
        bars, covered = np.concatenate([bars, angles]), np.concatenate([covered, by_edges])

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
