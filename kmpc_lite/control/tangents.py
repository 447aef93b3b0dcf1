"""Quickest ways from a pose to a pose around circles: straight lines and arcs, on the graph of all common tangents.

A way along the graph is smooth but at its two ends, so its time is that of its lines, its arcs, and of turning at the ends.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.dictionary import Array

TOUCHING = 1e-7
"""How deep a line may cut a circle [m]: rounding, since lines touch circles."""
FIRST_SENSE = np.array([1.0, 1.0, -1.0, -1.0])
SECOND_SENSE = np.array([1.0, -1.0, 1.0, -1.0])
"""Sense of rotation (1: counter-clockwise) at the first and the second circle of the four tangents of two circles."""
ARC_STEP = 0.15
"""Turn between two points of an arc [rad]; at 0.5 m the chord cuts 1.4 mm."""
NOTHING = 1e-9
"""Time of an arc of no length [s]: a zero would not count as an edge."""


@dataclass(frozen=True, eq=False)
class Way:
    """One way from start to goal."""

    points: Array
    """(K, 2) corners, arcs as short chords [m]."""
    headings: Array
    """(K,) direction of travel at each point [rad]; never jumps by 2 pi."""
    time: float
    """Driving and turning [s]."""
    reverse: bool
    """Whether it is driven backwards."""


def wrap(angle: Array) -> Array:
    """Angle in [-pi, pi)."""
    wrapped: Array = (angle + np.pi) % (2 * np.pi) - np.pi
    return wrapped


def quickest_ways(centres: Array, radii: Array, start: Array, goal: Array, area: Array, speed: Array) -> Iterator[Way]:
    """Yield ways from a pose to a pose, the quickest first: one for each first tangent and direction of driving.

    Parameters
    ----------
    centres, radii : ndarray
        Circles (M, 2), (M,) [m] that a way may touch but not cut; start and goal lie outside all of them.
    start, goal : ndarray
        Poses (3,).
    area : ndarray
        xmin, ymin, xmax, ymax (4,) that arcs must not leave; infinite where open.
    speed : ndarray
        Largest speed [m/s] and rate of turn [rad/s], (2,).

    Yields
    ------
    Way
        None at all where the circles leave no way.
    """
    count = len(centres)
    # start and goal are circles without radius
    points = np.concatenate([centres, start[None, :2], goal[None, :2]])
    sizes = np.append(radii, (0.0, 0.0))
    first, second, sense, ends, directions, lengths = _tangents(points, sizes, count, area)
    tangents = len(first)
    headings = np.arctan2(directions[:, 1], directions[:, 0])

    # Four nodes for each tangent, in the order of travel from the goal outwards: leaving the first circle, arriving there,
    # leaving the second, arriving there. A node belongs to one circle and one sense of rotation.
    circle = np.stack([first, first, second, second], axis=1).ravel()
    rotation = np.stack([sense[:, 0], -sense[:, 0], -sense[:, 1], sense[:, 1]], axis=1).ravel()
    places = np.repeat(ends, 2, axis=1).reshape(-1, 2)
    number = 4 * np.arange(tangents)
    tails, heads, times = [number, number + 2], [number + 3, number + 1], [lengths / speed[0]] * 2
    tail, head, turn = _arcs(points, sizes, count, area, circle, rotation, places)
    arc_time = turn * np.maximum(1.0 / speed[1], sizes[circle[tail]] / speed[0]) + NOTHING
    # two sources: the goal entered forwards and backwards, each with the turn that is left there
    last = np.flatnonzero(second == count + 1)
    for gear in (0, 1):
        tails.append(np.full(len(last), 4 * tangents + gear))
        heads.append(4 * last + 2)
        times.append(np.abs(wrap(goal[2] - headings[last] - gear * np.pi)) / speed[1] + NOTHING)
    size = 4 * tangents + 2
    graph = csr_matrix((np.concatenate([*times, arc_time]), (np.concatenate([*tails, tail]), np.concatenate([*heads, head]))), (size, size))
    distance, before = dijkstra(graph, indices=(size - 2, size - 1), return_predecessors=True)

    # candidates: tangents that end at the start, and the direct line
    to_start = np.flatnonzero((second == count) | ((first == count) & (second == count + 1)))
    direct = first[to_start] == count
    arrivals = 4 * to_start + np.where(direct, 1, 3)
    leaving = headings[to_start] + np.where(direct, 0.0, np.pi)
    total = distance[:, arrivals] + np.abs(wrap(start[2] - leaving - np.array([[0.0], [np.pi]]))) / speed[1]
    for choice in np.argsort(total, axis=None):
        gear, column = divmod(int(choice), len(arrivals))
        if not np.isfinite(total[gear, column]):
            return
        nodes = [int(arrivals[column])]
        while (following := int(before[gear, nodes[-1]])) < 4 * tangents:
            nodes.append(following)
        corners, along = _trace(nodes, points, sizes, circle, rotation, places, headings)
        yield Way(corners, along, float(total[gear, column]), gear == 1)


def _tangents(points: Array, sizes: Array, count: int, area: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Free tangents: circles (T,), (T,), senses (T, 2), ends (T, 2, 2), directions (T, 2), lengths (T,)."""
    first, second = np.triu_indices(count + 2, 1)
    offset = points[second] - points[first]
    distance = np.sqrt(np.einsum("pi,pi->p", offset, offset)) + 1e-12
    along = offset / distance[:, None]
    # cosine between the line of centres and the tangent's right-hand normal
    cosine = (sizes[first, None] * FIRST_SENSE - sizes[second, None] * SECOND_SENSE) / distance[:, None]
    exists = np.abs(cosine) < 1.0
    # a point has no sense of rotation: keep one of two equal lines
    exists[first >= count, 2:] = False
    exists[second >= count, 1::2] = False
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

    free = ((ends >= area[:2] - TOUCHING) & (ends <= area[2:] + TOUCHING)).all(axis=(1, 2))
    if count:
        # squared distance of every centre to every line
        reach = points[None, :count] - ends[:, :1]
        nearest = np.clip(np.einsum("tmi,ti->tm", reach, directions), 0.0, lengths[:, None])
        reach -= nearest[..., None] * directions[:, None]
        gap = np.einsum("tmi,tmi->tm", reach, reach) - np.maximum(sizes[:count] - TOUCHING, 0.0) ** 2
        rows = np.arange(len(first))
        for own in (first, second):
            is_circle = own < count
            gap[rows[is_circle], own[is_circle]] = 0.0
        free &= gap.min(axis=1) >= 0.0
    return first[free], second[free], sense[free], ends[free], directions[free], lengths[free]


def _arcs(
    points: Array, sizes: Array, count: int, area: Array, circle: Array, rotation: Array, places: Array
) -> tuple[Array, Array, Array]:
    """Free arcs from a node to the next one of its circle and sense: nodes (E,), (E,) and turns (E,) [rad]."""
    nodes = np.flatnonzero(circle < count)
    owner, sense = circle[nodes], rotation[nodes]
    away = places[nodes] - points[owner]
    angle = np.arctan2(away[:, 1], away[:, 0])
    # where another circle or a side of the area covers a piece of a circle, its middle bars the arc
    offset = points[None, :count] - points[:count, None]
    distance = np.sqrt(np.einsum("mki,mki->mk", offset, offset))
    np.fill_diagonal(distance, np.inf)
    covered, by = np.nonzero((distance < sizes[:count, None] + sizes[:count]) & (distance > sizes[:count] - sizes[:count, None]))
    bars = np.arctan2(offset[covered, by, 1], offset[covered, by, 0])
    sides = np.concatenate([points[:count] - area[:2], area[2:] - points[:count]], axis=1) < sizes[:count, None]
    beyond, side = np.nonzero(sides)
    bars = np.concatenate([bars, np.array([np.pi, -np.pi / 2, 0.0, np.pi / 2])[side]])
    covered = np.concatenate([covered, beyond])

    number = np.concatenate([nodes, np.full(2 * len(bars), -1)])
    owner = np.concatenate([owner, covered, covered])
    sense = np.concatenate([sense, np.ones(len(bars)), -np.ones(len(bars))])
    turned = (sense * np.concatenate([angle, bars, bars])) % (2 * np.pi)
    layer = 2 * owner + (sense > 0)
    order = np.lexsort((turned, layer))
    number, layer, turned = number[order], layer[order], turned[order]
    if not len(number):
        return number, number, turned
    # the one after the last of a layer is its first
    following = np.arange(1, len(number) + 1)
    is_last = np.append(layer[1:] != layer[:-1], True)
    following[is_last] = np.concatenate([[0], np.flatnonzero(is_last)[:-1] + 1])
    turn = (turned[following] - turned) % (2 * np.pi)
    use = (number >= 0) & (number[following] >= 0) & (number != number[following])
    return number[use], number[following][use], turn[use]


def _trace(
    nodes: list[int], points: Array, sizes: Array, circle: Array, rotation: Array, places: Array, headings: Array
) -> tuple[Array, Array]:
    """Points (K, 2) and headings (K,) along nodes, which run from the start to the goal."""
    corners: list[Array] = []
    along: list[Array] = []
    heading = 0.0
    i = 0
    while i < len(nodes) - 1:
        here, there = nodes[i], nodes[i + 1]
        if here // 4 == there // 4 and circle[here] != circle[there]:
            forward = here % 4 < 2
            line = float(headings[here // 4]) + (0.0 if forward else np.pi)
            # the line continues the arc before it
            heading = line if not along else float(along[-1][-1] + wrap(line - along[-1][-1]))
            corners.append(places[[here, there]])
            along.append(np.array([heading, heading]))
            i += 1
            continue
        j = i + 1
        while j < len(nodes) - 1 and circle[nodes[j + 1]] == circle[here]:
            j += 1
        owner = circle[here]
        # nodes were found from the goal outwards, so the way turns against their rotation
        sense = -rotation[here]
        begin, end = places[here] - points[owner], places[nodes[j]] - points[owner]
        turn = (sense * (np.arctan2(end[1], end[0]) - np.arctan2(begin[1], begin[0]))) % (2 * np.pi)
        steps = sense * np.linspace(0.0, turn, 2 + int(turn / ARC_STEP))[1:-1]
        angle = np.arctan2(begin[1], begin[0]) + steps
        corners.append(points[owner] + sizes[owner] * np.stack([np.cos(angle), np.sin(angle)], axis=1))
        along.append(heading + steps)
        # so that the next line sees the whole turn
        heading = heading + sense * turn
        corners.append(places[nodes[j]][None])
        along.append(np.array([heading]))
        i = j
    return np.concatenate(corners), np.concatenate(along)
