"""Quickest paths around circles and polygons, of lines and arcs: the graph of all tangents.

A polygon is the circles of its corners and the edges between these, a wall is one edge.

Beside the obstacles there are four circles to turn on, left and right of start and goal, so that a
path can leave the start and enter the goal along their headings; where these have no place, the
robot turns on the spot.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lite.control.path.bitangents import (
    TURNING,
    Circles,
    Tangents,
    free_arcs,
    free_tangents,
)
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.path.lattice_path import LatticePath

CUT_DEPTH = 0.002
"""How deep the chords of a path's arcs may cut an inflated circle [m]."""
ARC_STEP = 0.15
"""Largest turn between two points of an arc [rad]."""
TURNING_RADIUS_SHARE = 0.3
"""Radius of the circles beside start and goal on which the robot may turn, as a share of the
distance between them."""
TURNING_RADIUS_LIMIT = 0.5
"""Largest radius of these circles [m]."""
QUANTUM_CIRCLES = 37.5
"""Circles whose tangents are found in one quantum."""

ROUNDING = 1e-9
"""Length [m] or angle [rad] that is none."""
INSTANT = 1e-9
"""Time of an arc of no length [s]: a zero would not count as an edge."""
WHOLE_TURN = 2 * math.pi - 1e-6
"""A turn that is larger is the rounding of no turn at all [rad]."""
NODE_SENSE = np.array([[1.0, -1.0], [-1.0, 1.0]])
"""Sense of rotation of a tangent's four nodes, as a multiple of the tangent's: by circle, then
leaving and arriving."""
GEARS = np.array([[0.0], [np.pi]])
"""What the robot's heading is off the direction of travel: forwards, backwards."""
LEFT_RIGHT = np.array([1.0, -1.0])
POSE_SENSE = np.array([-1.0, 1.0, 1.0, -1.0])
"""Sense of rotation, against the path, of a pose's four nodes: left forwards and backwards, right
forwards and backwards."""


@dataclass(frozen=True, eq=False, slots=True)
class GeometricPath:
    """One path from start to goal, without times."""

    points: Array
    """(K, 2) corners, arcs as short chords [m]."""
    headings: Array
    """(K,) direction of travel at each point [rad]; never jumps by 2 pi."""
    time: float
    """Driving and turning [s]."""
    reverse: bool
    """Whether it is driven backwards."""


@dataclass(frozen=True, eq=False, slots=True)
class PathQuery:
    """Between what, and around what, a path is looked for."""

    start: Array
    """Pose (3,)."""
    goal: Array
    """Pose (3,)."""
    centres: Array
    """(M, 2) of the inflated circles [m]."""
    radii: Array
    """(M,) [m]; a path may touch them but not cut them; start and goal lie outside all of them."""
    edges: Array
    """(S, 2) pairs of circles of one radius, between which a path must not pass either."""
    area: Array
    """(4,) xmin, ymin, xmax, ymax that arcs must not leave [m]; infinite if open."""
    speed: Array
    """(2,) largest speed [m/s] and rate of turn [rad/s]."""
    backward_share: float = 1.0
    """How fast the robot drives backwards, as a share of forwards; 0 if it may not."""
    lattice_path: LatticePath | None = None
    """Path through a grid's many corners, which tells the few that matter."""
    look_times: tuple[float, float] = (0.0, 0.0)
    """What a path takes longer forwards, and backwards, for the robot must stop to look [s]."""
    either_gear: bool = False
    """Whether a robot may fit on a path in one gear and not in the other."""


class TangentGraph:
    """The graph of some circles' tangents.

    It is built by `build`; then `next_candidate` and `trace` give one path after the other, the
    quickest first.

    Parameters
    ----------
    query : PathQuery
        Start, goal, area and speeds.
    centres, radii : ndarray
        Circles (M, 2), (M,) that are looked at [m].
    edges : ndarray
        Pairs (S, 2) of these.
    """

    def __init__(
        self,
        query: PathQuery,
        centres: Array,
        radii: Array,
        edges: Array,
    ) -> None:
        self._query = query
        start, goal = query.start, query.goal
        self._ends = np.stack([start, goal])
        across = np.stack([-np.sin(self._ends[:, 2]), np.cos(self._ends[:, 2])], axis=1)
        apart = math.hypot(goal[0] - start[0], goal[1] - start[1])
        turning = min(TURNING_RADIUS_SHARE * apart, TURNING_RADIUS_LIMIT)
        beside = self._ends[:, None, :2] + turning * LEFT_RIGHT[:, None] * across[:, None]
        points = np.concatenate([centres, beside.reshape(-1, 2), self._ends[:, :2]])
        sizes = np.concatenate([radii, np.full(TURNING, turning), (0.0, 0.0)])
        self._circles = Circles(points, sizes, len(centres), edges, query.area)
        self._rank = -1

    def build(self) -> Iterator[int]:
        """Build and solve it, part by part; how many quanta each of them takes comes first."""
        # each tangent, of which there are as many as pairs of circles, is looked at beside each
        # circle
        yield max(round((self._circles.count / QUANTUM_CIRCLES) ** 3), 1)
        self._add_tangents()
        yield 1
        self._arcs = free_arcs(self._circles, self._circle, self._rotation, self._places)
        yield 1
        self._link()
        yield 1
        self._solve()

    def _add_tangents(self) -> None:
        """Find the free tangents, and number the nodes.

        There are four nodes for each tangent, in the order of travel from the goal outwards:
        leaving the first circle, arriving there, leaving the second, arriving there. A node belongs
        to one circle and one sense of rotation. Then there are four nodes each for start and goal
        on the circles beside them, and two where the search begins.
        """
        self._tangents: Tangents = free_tangents(self._circles, self._query.lattice_path)
        t = self._tangents
        self._headings = np.arctan2(t.directions[:, 1], t.directions[:, 0])
        self._number = 4 * np.arange(len(t.first))
        self._size = 4 * len(t.first) + 10
        of_tangents = np.stack([t.first, t.first, t.second, t.second], axis=1).ravel()
        of_poses = self._circles.count + np.repeat(np.arange(4), 2)
        self._circle = np.concatenate([of_tangents, of_poses])
        senses = (t.senses[:, :, None] * NODE_SENSE).ravel()
        self._rotation = np.concatenate([senses, POSE_SENSE, POSE_SENSE])
        at_tangents = np.repeat(t.ends, 2, axis=1).reshape(-1, 2)
        self._places = np.concatenate([at_tangents, np.repeat(self._ends[:, :2], 4, axis=0)])

    def _link(self) -> None:
        """Make the graph: tangents in both directions, arcs, and how the goal is entered."""
        t, (tail, head, turn) = self._tangents, self._arcs
        number, begin, speed = self._number, self._size - 2, self._query.speed
        # the goal is entered forwards or backwards, along its heading or with a turn on the spot
        last = np.flatnonzero(t.second == self._circles.count + TURNING + 1)
        off = np.abs(wrap(self._query.goal[2] - self._headings[last] - GEARS))
        final = off / speed[1] + INSTANT
        into_goal = 4 * len(t.first) + 4 + np.arange(4)
        along_heading = (begin, begin + 1, begin, begin + 1)
        with_turn = np.repeat((begin, begin + 1), len(last))
        tails = np.concatenate([number, number + 2, tail, along_heading, with_turn])
        heads = np.concatenate(
            [number + 3, number + 1, head, into_goal, 4 * last + 2, 4 * last + 2]
        )
        driving = t.lengths / speed[0]
        sizes = self._circles.sizes[self._circle[tail]]
        arc_time = turn * np.maximum(1.0 / speed[1], sizes / speed[0]) + INSTANT
        times = np.concatenate([driving, driving, arc_time, np.full(4, INSTANT), final.ravel()])
        by_tail = np.argsort(tails, kind="stable")
        begins = np.zeros(self._size + 1, dtype=np.int32)
        np.cumsum(np.bincount(tails, minlength=self._size), out=begins[1:])
        self._graph = csr_matrix(
            (times[by_tail], heads[by_tail].astype(np.int32), begins), (self._size, self._size)
        )

    def _solve(self) -> None:
        """Find the quickest paths from the goal to all nodes, and rank those that reach the start.

        Candidates are tangents that end at the start, with a turn there first, and the circles
        beside it.
        """
        begins = (self._size - 2, self._size - 1)
        times, self._before = dijkstra(self._graph, indices=begins, return_predecessors=True)
        t, start = self._tangents, self._query.start
        start_point = self._circles.count + TURNING
        to_start = np.flatnonzero((t.second == start_point) | (t.first == start_point))
        outward = t.second[to_start] == start_point
        self._leaving = self._headings[to_start] + np.where(outward, np.pi, 0.0)
        at_start = 4 * len(t.first) + np.arange(4)
        self._arrivals = np.concatenate([4 * to_start + np.where(outward, 3, 1), at_start])
        total = times[:, self._arrivals]
        total[:, :-4] += np.abs(wrap(start[2] - self._leaving - GEARS)) / self._query.speed[1]
        # forwards and backwards alternate
        total[0, -3::2] = total[1, -4::2] = np.inf
        # turns on the spot count as slower too: that is only for the choice
        backward = self._query.backward_share
        total[1] = total[1] / backward if backward > 0.0 else np.inf
        total += np.array(self._query.look_times)[:, None]
        self._total, self._order = total, np.argsort(total, axis=None)

    def next_candidate(self) -> bool:
        """Go to the next quickest path, and tell whether there is one."""
        self._rank += 1
        gear, column = divmod(int(self._order[self._rank]), len(self._arrivals))
        if not np.isfinite(self._total[gear, column]):
            return False
        nodes = [int(self._arrivals[column])]
        while (following := int(self._before[gear, nodes[-1]])) < self._size - 2:
            nodes.append(following)
        self._nodes, self._gear, self._column = nodes, gear, column
        return True

    @property
    def time(self) -> float:
        """Driving and turning of the candidate [s]."""
        return float(self._total[self._gear, self._column])

    def trace(self) -> GeometricPath:
        """Points and headings of the candidate."""
        gear, column = self._gear, self._column
        if column < len(self._leaving):
            heading = float(self._leaving[column])
        else:
            heading = float(self._query.start[2]) + gear * math.pi
        rows = np.array(self._points_along(heading))
        return GeometricPath(rows[:, :2], rows[:, 2], self.time, gear == 1)

    def _points_along(self, heading: float) -> list[tuple[float, float, float]]:
        """Rows x, y, heading along the candidate's nodes; the start is left at a heading [rad]."""
        nodes = self._nodes
        places, owners = self._places[nodes].tolist(), self._circle[nodes].tolist()
        rows: list[tuple[float, float, float]] = [(*places[0], heading)]
        i, last = 0, len(nodes) - 1
        while i < last:
            owner = owners[i]
            if owner != owners[i + 1]:
                rows.append((*places[i + 1], heading))
                i += 1
                continue
            j = i + 1
            while j < last and owners[j + 1] == owner:
                j += 1
            # nodes were found from the goal outwards, so the path turns against their rotation
            sense = -float(self._rotation[nodes[i]])
            x, y = self._circles.points[owner].tolist()
            radius = float(self._circles.sizes[owner])
            begin = math.atan2(places[i][1] - y, places[i][0] - x)
            end = math.atan2(places[j][1] - y, places[j][0] - x)
            turn = (sense * (end - begin)) % math.tau
            if turn > WHOLE_TURN:
                turn = 0.0
            pieces = 1 + int(turn / arc_step(radius))
            for piece in range(1, pieces + 1):
                step = sense * turn * piece / pieces
                at = begin + step
                rows.append((x + radius * math.cos(at), y + radius * math.sin(at), heading + step))
            heading += sense * turn
            i = j
        return rows


def arc_step(radius: float) -> float:
    """Turn between two points of an arc [rad], so that its chords cut the circle as allowed.

    The larger the radius [m], the deeper a chord of the same turn cuts: by radius * turn^2 / 8.
    """
    # a little less than allowed, so that rounding does not make it more
    depth = (1.0 - 1e-6) * CUT_DEPTH
    if radius * (1.0 - math.cos(0.5 * ARC_STEP)) <= depth:
        return ARC_STEP
    return 2.0 * math.acos(1.0 - depth / radius)
