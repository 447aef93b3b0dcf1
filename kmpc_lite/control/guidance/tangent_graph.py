"""Quickest ways from a pose to a pose around circles and polygons: straight lines and arcs, on the graph of all common tangents.

A polygon is the circles of its corners and the edges between these, a wall is one edge.

Beside the obstacles there are four circles to turn on, left and right of start and goal, so that a
way can leave the start and enter the goal along their headings; where there is no room for these,
the robot turns on the spot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra

from kmpc_lite.control.guidance.bitangents import TURNING, free_arcs, free_tangents
from kmpc_lite.control.guidance.edges import cut_edges
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.guidance.lattice import LatticePath

CHORD = 2e-3
"""How deep a way may cut a circle [m]: chords of arcs do."""
ARC_STEP = 0.15
"""Turn between two points of an arc [rad]; at 0.5 m the chord cuts 1.4 mm."""
TURNING_RADIUS = (0.3, 0.5)
"""Radius of the circles to turn on: as a share of the distance to the goal, and at the most [m]."""
NOTHING = 1e-9
"""Time of an arc of no length [s]: a zero would not count as an edge."""
NODE_SENSE = np.array([[1.0, -1.0], [-1.0, 1.0]])
"""Sense of rotation of a tangent's four nodes, as a multiple of the tangent's: by circle, then
leaving and arriving."""
GEARS = np.array([[0.0], [np.pi]])
"""What the robot's heading is off the direction of travel: forwards, backwards."""
ROUNDS = 12
"""How often corners that a way through a maze cuts are added before the lattice's way is taken."""
NO_POINTS = np.empty((0, 2))
NO_EDGES = np.empty((0, 2), dtype=np.intp)
LEFT_RIGHT = np.array([1.0, -1.0])
POSE_SENSE = np.array([-1.0, 1.0, 1.0, -1.0])
"""Sense of rotation, against the way, of a pose's four nodes: left forwards and backwards, right
forwards and backwards."""


@dataclass(frozen=True, eq=False)
class GeometricPath:
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


def cut_circles(points: Array, centres: Array, radii: Array) -> Array:
    """Which circles (M,) a line through points (K, 2) cuts."""
    # coordinate by coordinate: half the time of pairs
    x, y = points[:-1, 0, None], points[:-1, 1, None]
    dx, dy = points[1:, 0, None] - x, points[1:, 1, None] - y
    away_x, away_y = centres[:, 0] - x, centres[:, 1] - y
    share = (away_x * dx + away_y * dy) / (dx * dx + dy * dy + 1e-12)
    np.minimum(np.maximum(share, 0.0, out=share), 1.0, out=share)
    away_x -= share * dx
    away_y -= share * dy
    cut: Array = (away_x * away_x + away_y * away_y < np.maximum(radii - CHORD, 0.0) ** 2).any(
        axis=0
    )
    return cut


def quickest_paths(
    centres: Array,
    radii: Array,
    start: Array,
    goal: Array,
    area: Array,
    speed: Array,
    backward: float = 1.0,
    edges: Array = NO_EDGES,
) -> Iterator[GeometricPath]:
    """Yield ways from a pose to a pose, the quickest first: one for each first tangent and direction of driving.

    Only circles that the quickest way would cut without them, and the walls of circles that overlap
    with these, make it into the graph, so that far ones cost next to nothing; the first way is the
    quickest of all around all circles, the later ones are a choice.

    Parameters
    ----------
    centres, radii : ndarray
        Circles (M, 2), (M,) [m] that a way may touch but not cut; start and goal lie outside all of
        them.
    start, goal : ndarray
        Poses (3,).
    area : ndarray
        xmin, ymin, xmax, ymax (4,) that arcs must not leave; infinite where open.
    speed : ndarray
        Largest speed [m/s] and rate of turn [rad/s], (2,).
    backward : float
        How fast the robot drives backwards, as a share of forwards; 0 where it may not.
    edges : ndarray
        Pairs (S, 2) of circles of one radius, between which a way must not pass either.

    Yields
    ------
    Way
        None at all where the circles leave no way.
    """
    for way in paths_in_parts(centres, radii, start, goal, area, speed, backward, edges):
        if way is not None:
            yield way


def paths_in_parts(
    centres: Array,
    radii: Array,
    start: Array,
    goal: Array,
    area: Array,
    speed: Array,
    backward: float = 1.0,
    edges: Array = NO_EDGES,
    route: LatticePath | None = None,
) -> Iterator[GeometricPath | None]:
    """Yield what `quickest_paths` does, and None between its parts: each takes about as long, and the caller may come back later.

    With a `route` through a maze, also around its corners; where these give no way, the route
    itself, with turns on the spot.
    """
    touched = NO_POINTS if route is None else route.corners
    rounds, some = 0, False
    known = _with_corners(_cut(np.stack([start[:2], goal[:2]]), centres, radii, edges), edges)
    while True:
        found = 0
        renumbered = (np.cumsum(known) - 1)[edges[known[edges[:, 0]]]]
        points, sizes = centres[known], radii[known]
        if route is not None:
            points, sizes = (
                np.concatenate([points, touched]),
                np.concatenate([sizes, np.full(len(touched), route.radius)]),
            )
        for way in _graph_ways(
            points, sizes, start, goal, area, speed, backward, renumbered, route
        ):
            if way is None:
                yield None
                continue
            cut = _cut(way.points, centres, radii, edges)
            deep = NO_POINTS if route is None else route.cut(way.points)
            if not cut.any() and not len(deep):
                found, some = found + 1, True
                yield way
            elif not found and (len(deep) or not known[cut].all()):
                break
        else:
            if route is not None and not some and not known.any():
                yield _straight_way(route.points, start, goal, speed)
            return
        if route is not None:
            touched, rounds = np.concatenate([touched, deep]), rounds + 1
            if rounds > ROUNDS:
                yield _straight_way(route.points, start, goal, speed)
                return
        known = _walls(known | cut, centres, radii, edges)


def _straight_way(points: Array, start: Array, goal: Array, speed: Array) -> GeometricPath:
    """Way straight from point to point (K, 2), forwards, with turns on the spot."""
    steps = np.diff(points, axis=0)
    turns = wrap(np.diff(np.arctan2(steps[:, 1], steps[:, 0]), prepend=start[2]))
    headings = start[2] + np.cumsum(turns)
    time = np.hypot(steps[:, 0], steps[:, 1]).sum() / speed[0]
    time += (np.abs(turns).sum() + abs(wrap(goal[2] - headings[-1]))) / speed[1]
    return GeometricPath(
        np.stack([points[:-1], points[1:]], axis=1).reshape(-1, 2),
        np.repeat(headings, 2),
        float(time),
        False,
    )


def _cut(points: Array, centres: Array, radii: Array, edges: Array) -> Array:
    """Which circles (M,) a line through points (K, 2) cuts, themselves or an edge of theirs."""
    cut = cut_circles(points, centres, radii)
    if len(edges):
        first, second = edges.T
        cut[
            edges[
                cut_edges(
                    points, centres[first], centres[second], np.maximum(radii[first] - CHORD, 0.0)
                )
            ]
        ] = True
    return cut


def _with_corners(known: Array, edges: Array) -> Array:
    """Circles (M,) that are known, or corners of a polygon of which one is known."""
    while (half_known := known[edges].any(axis=1) & ~known[edges].all(axis=1)).any():
        known[edges[half_known]] = True
    return known


def _walls(known: Array, centres: Array, radii: Array, edges: Array) -> Array:
    """Circles (M,) that belong to a wall, of circles that overlap, or to a polygon, with a known one."""
    away = centres[:, None] - centres
    overlap = np.einsum("mki,mki->mk", away, away) < (radii[:, None] + radii) ** 2
    if len(edges):
        # a building's walls all hang together: of these only those that are met are looked at
        corners = np.unique(edges)
        overlap[corners], overlap[:, corners] = False, False
        overlap[edges[:, 0], edges[:, 1]] = True
        overlap[corners, corners] = True
    _, wall = connected_components(csr_matrix(overlap), directed=False)
    own: Array = np.isin(wall, wall[known])
    return own


def _graph_ways(
    centres: Array,
    radii: Array,
    start: Array,
    goal: Array,
    area: Array,
    speed: Array,
    backward: float,
    edges: Array,
    route: LatticePath | None,
) -> Iterator[GeometricPath | None]:
    """Yield the ways that the graph of these circles' tangents holds, and None between the parts of the work."""
    count = len(centres)
    # obstacles, circles to turn on, and start and goal as circles without radius
    ends_of_way = np.stack([start, goal])
    across = np.stack([-np.sin(ends_of_way[:, 2]), np.cos(ends_of_way[:, 2])], axis=1)
    turning = min(
        TURNING_RADIUS[0] * math.hypot(goal[0] - start[0], goal[1] - start[1]), TURNING_RADIUS[1]
    )
    beside = ends_of_way[:, None, :2] + turning * LEFT_RIGHT[:, None] * across[:, None]
    points = np.concatenate([centres, beside.reshape(-1, 2), ends_of_way[:, :2]])
    sizes = np.concatenate([radii, np.full(TURNING, turning), (0.0, 0.0)])
    yield None
    first, second, sense, ends, directions, lengths = free_tangents(
        points, sizes, count, area, edges, route
    )
    tangents, start_point, goal_point = len(first), count + TURNING, count + TURNING + 1
    headings = np.arctan2(directions[:, 1], directions[:, 0])
    yield None

    # Four nodes for each tangent, in the order of travel from the goal outwards: leaving the first
    # circle, arriving there, leaving the second, arriving there. A node belongs to one circle and
    # one sense of rotation. Then four nodes each for start and goal on the circles beside them, and
    # two where the search begins.
    number, pose = 4 * np.arange(tangents), 4 * tangents + np.arange(8)
    size = 4 * tangents + 10
    circle = np.concatenate(
        [
            np.stack([first, first, second, second], axis=1).ravel(),
            count + np.repeat(np.arange(4), 2),
        ]
    )
    rotation = np.concatenate([(sense[:, :, None] * NODE_SENSE).ravel(), POSE_SENSE, POSE_SENSE])
    places = np.concatenate(
        [np.repeat(ends, 2, axis=1).reshape(-1, 2), np.repeat(ends_of_way[:, :2], 4, axis=0)]
    )
    tail, head, turn = free_arcs(points, sizes, count, area, circle, rotation, places, edges)
    yield None
    # the goal is entered forwards or backwards, along its heading or with a turn that is left there
    last = np.flatnonzero(second == goal_point)
    final = np.abs(wrap(goal[2] - headings[last] - GEARS)) / speed[1] + NOTHING
    tails = np.concatenate(
        [
            number,
            number + 2,
            tail,
            (size - 2, size - 1, size - 2, size - 1),
            np.repeat((size - 2, size - 1), len(last)),
        ]
    )
    heads = np.concatenate([number + 3, number + 1, head, pose[4:], 4 * last + 2, 4 * last + 2])
    driving = lengths / speed[0]
    arc_time = turn * np.maximum(1.0 / speed[1], sizes[circle[tail]] / speed[0]) + NOTHING
    times = np.concatenate([driving, driving, arc_time, np.full(4, NOTHING), final.ravel()])
    by_tail = np.argsort(tails, kind="stable")
    begins = np.zeros(size + 1, dtype=np.int32)
    np.cumsum(np.bincount(tails, minlength=size), out=begins[1:])
    graph = csr_matrix((times[by_tail], heads[by_tail].astype(np.int32), begins), (size, size))
    yield None
    distance, before = dijkstra(graph, indices=(size - 2, size - 1), return_predecessors=True)

    # candidates: tangents that end at the start, with a turn there first, and the circles beside it
    to_start = np.flatnonzero((second == start_point) | (first == start_point))
    outward = second[to_start] == start_point
    leaving = headings[to_start] + np.where(outward, np.pi, 0.0)
    arrivals = np.concatenate([4 * to_start + np.where(outward, 3, 1), pose[:4]])
    total = distance[:, arrivals]
    total[:, :-4] += np.abs(wrap(start[2] - leaving - GEARS)) / speed[1]
    # forwards and backwards alternate
    total[0, -3::2] = total[1, -4::2] = np.inf
    # turns on the spot count as slower too: that is only for the choice
    total[1] = total[1] / backward if backward > 0.0 else np.inf
    for choice in np.argsort(total, axis=None):
        gear, column = divmod(int(choice), len(arrivals))
        if not np.isfinite(total[gear, column]):
            return
        nodes = [int(arrivals[column])]
        while (following := int(before[gear, nodes[-1]])) < size - 2:
            nodes.append(following)
        away = float(leaving[column]) if column < len(leaving) else float(start[2]) + gear * math.pi
        yield None
        corners, along = _trace(nodes, away, points, sizes, circle, rotation, places)
        yield GeometricPath(corners, along, float(total[gear, column]), gear == 1)


def _trace(
    nodes: list[int],
    heading: float,
    points: Array,
    sizes: Array,
    circle: Array,
    rotation: Array,
    places: Array,
) -> tuple[Array, Array]:
    """Points (K, 2) and headings (K,) along nodes, which run from the start, left at `heading`, to the goal."""
    place, owners = places[nodes].tolist(), circle[nodes].tolist()
    rows: list[tuple[float, float, float]] = [(*place[0], heading)]
    i, last = 0, len(nodes) - 1
    while i < last:
        owner = owners[i]
        if owner != owners[i + 1]:
            rows.append((*place[i + 1], heading))
            i += 1
            continue
        j = i + 1
        while j < last and owners[j + 1] == owner:
            j += 1
        # nodes were found from the goal outwards, so the way turns against their rotation
        sense, radius, (x, y) = (
            -float(rotation[nodes[i]]),
            float(sizes[owner]),
            points[owner].tolist(),
        )
        begin = math.atan2(place[i][1] - y, place[i][0] - x)
        turn = (sense * (math.atan2(place[j][1] - y, place[j][0] - x) - begin)) % (2 * math.pi)
        if turn > 2 * math.pi - 1e-6:
            # rounding of no turn at all
            turn = 0.0
        pieces = 1 + int(turn / ARC_STEP)
        for piece in range(1, pieces + 1):
            step = sense * turn * piece / pieces
            rows.append(
                (
                    x + radius * math.cos(begin + step),
                    y + radius * math.sin(begin + step),
                    heading + step,
                )
            )
        heading += sense * turn
        i = j
    way = np.array(rows)
    return way[:, :2], way[:, 2]
