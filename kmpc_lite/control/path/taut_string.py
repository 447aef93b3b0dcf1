"""A line between obstacles, pulled taut: straight lines, and arcs around what is in the way.

A string lies around discs: circles and corners as large as what is in the way and the distance that
is kept from it. Beside start and goal there may be one more, on which the robot turns into the path
and out of it, along its headings; without it turns on the spot.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.path.distance_grid import CUT, QUANTUM, SAMPLE, DistanceGrid
from kmpc_lite.control.path.planner import ROUNDING, PathRequest
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

CUT_DEPTH = 0.002  # how deep the chords of a path's arcs may cut an inflated circle [m]
BACK_OFF = 0.001
"""Start or goal may lie nearer to an obstacle than the path's clearance. The path may then come
nearer than they do by this much [m]."""
ARC_STEP = 0.15  # largest turn between two points of an arc [rad]
TURNING_RADIUS_SHARE = 0.3
"""Radius of the circles beside start and goal on which the robot may turn, as a share of the
distance between them."""
TURNING_RADIUS_LIMIT = 0.5  # largest radius of these circles [m]
ROUNDS = 12  # how often a string is laid around what it still cuts
LOOK = 80  # from each corner, the farthest point in sight is looked for among so many
WHOLE_TURN = 2 * math.pi - 1e-6  # a turn that is larger is the rounding of no turn at all [rad]
FULL = 1.0 - 1e-9
"""Share of their distance by which two discs that have a common tangent differ at most."""
LONG_WAY = -0.5 * math.pi
"""A disc around which a string turns by less, the other way, is none that it lies around [rad]."""


@dataclass(frozen=True, eq=False, slots=True)
class GeometricPath:
    """One path from start to goal, without times."""

    points: Array  # (K, 2) corners, arcs as short chords [m]
    headings: Array  # (K,) direction of travel at each point [rad]; never jumps by 2 pi
    time: float  # driving and turning [s]
    reverse: bool  # whether it is driven backwards


class Disc(NamedTuple):
    """What a string lies around."""

    x: float
    y: float
    radius: float
    sense: float  # 1 if it lies to the left of the string, -1 to the right, 0 of a point

    def at(self, course: float) -> tuple[float, float]:
        """Where a string touches it that leads there in a direction [rad]."""
        out = self.sense * self.radius
        return self.x + out * math.sin(course), self.y - out * math.cos(course)


class Contact(NamedTuple):
    """A disc, and where along a line a string comes to it [m]."""

    along: float
    disc: Disc


class Line(NamedTuple):
    """From start to goal, pulled straight: it tells on which sides of what strings lie."""

    corners: Array  # (K, 2) [m]
    contacts: list[Contact]  # at each of those between start and goal


class Surroundings:
    """What strings of one clearance lie around.

    `request`: start, goal, obstacles. `grid`: of its obstacles. `kept`: distance from them [m].
    """

    def __init__(self, request: PathRequest, grid: DistanceGrid, kept: float) -> None:
        self._request, self._grid, self.kept = request, grid, kept
        self._ends = np.stack([request.start[:2], request.goal[:2]])
        # start and goal stay outside of all discs
        most = float(request.distances(self._ends).min()) - BACK_OFF
        self.least = max(min(kept, most), 0.0)
        solids = request.solids
        self._edges = len(request.circles) + (solids.outlines.edge_count if solids else 0)
        self.quanta = 0  # of the last look along a line, beside the one that any takes

    def contact(self, point: Array, corners: Array) -> Contact:
        """Disc about what is nearest to a point (2,), on its side of a line with corners (K, 2)."""
        nearest = self._request.nearest(point[None])
        centre, size = nearest.centre[0], float(nearest.size[0])
        outside = float(np.hypot(*(self._ends - centre).T).min()) - BACK_OFF
        radius = max(min(size + self.kept, outside), 0.0)
        along, left = beside_line(centre, corners)
        x, y = centre.tolist()
        return Contact(along, Disc(x, y, radius, math.copysign(1.0, left)))

    def pulled(self, points: Array) -> Array:
        """Corners (K, 2) of a line through points (n, 2), pulled straight."""
        bends, last = [0], len(points) - 1
        while bends[-1] < last:
            ahead = np.arange(bends[-1] + 1, min(bends[-1] + LOOK, len(points)))
            here = np.repeat(points[bends[-1] : bends[-1] + 1], len(ahead), axis=0)
            seen = self._grid.lines_free(here, points[ahead], self.least)
            bends.append(int(ahead[np.flatnonzero(seen)[-1]] if seen.any() else ahead[0]))
        return points[bends]

    def cut(self, points: Array) -> tuple[Array, Array]:
        """Where a line through points (K, 2) comes too near to something.

        The nearest place in each stretch is returned, (C, 2) [m], and on which piece of the line
        it lies, (C,).
        """
        steps = np.diff(points, axis=0)
        lengths = np.hypot(steps[:, 0], steps[:, 1])
        along = np.append(0.0, np.cumsum(lengths))
        places = np.arange(0.0, along[-1], SAMPLE)
        dense = np.column_stack([np.interp(places, along, points[:, i]) for i in (0, 1)])
        # the grid tells where to look
        close = np.flatnonzero(self._grid.distances(dense) < self.least + SAMPLE + self._grid.step)
        if not len(close):
            return dense[:0], close
        self.quanta = len(close) * self._edges // QUANTUM
        distance = self._request.distances(dense[close])
        inside = distance < self.least - CUT
        ends = np.flatnonzero((np.diff(close) > 1) | np.diff(inside)) + 1
        stretches = np.split(np.arange(len(close)), ends)
        deepest = [s[np.argmin(distance[s])] for s in stretches if len(s) and inside[s[0]]]
        at = close[deepest]
        pieces = np.clip(np.searchsorted(along, places[at], side="right") - 1, 0, len(steps) - 1)
        return dense[at], pieces


def beside_line(point: Array, corners: Array) -> tuple[float, float]:
    """Where along a line with corners (K, 2) a point (2,) lies [m], and on which side, left > 0."""
    steps, away = np.diff(corners, axis=0), point - corners[:-1]
    lengths = np.maximum(np.hypot(steps[:, 0], steps[:, 1]), ROUNDING)
    share = np.clip(np.einsum("ki,ki->k", away, steps) / lengths**2, 0.0, 1.0)
    off = away - share[:, None] * steps
    nearest = int(np.hypot(off[:, 0], off[:, 1]).argmin())
    left = steps[nearest, 0] * away[nearest, 1] - steps[nearest, 1] * away[nearest, 0]
    return float(lengths[:nearest].sum() + share[nearest] * lengths[nearest]), float(left)


class String:
    """A string around discs: straight lines, and arcs on the discs.

    `request`: start, goal, speeds. `discs`: of start and goal, and those between: each has a common
    tangent with the next. `courses`: directions of these tangents [rad]. `reverse`: whether it is
    driven backwards.
    """

    def __init__(
        self, request: PathRequest, discs: list[Disc], courses: list[float], reverse: bool
    ) -> None:
        self.discs, self._courses, self._reverse = discs, courses, reverse
        speed, turn_rate = request.forward.tolist()
        begin, end = (float(pose[2]) + math.pi * reverse for pose in (request.start, request.goal))
        before, after = [begin, *courses], [*courses, end]
        self._begin = begin if discs[0].sense else courses[0]
        self._turns = [
            _turn_on(d.sense * (b - a)) for d, a, b in zip(discs, before, after, strict=True)
        ]
        time = 0.0
        for disc, turn in zip(discs, self._turns, strict=True):
            time += turn * max(1.0 / turn_rate, disc.radius / speed)
        for disc, off in ((discs[0], courses[0] - begin), (discs[-1], end - courses[-1])):
            time += 0.0 if disc.sense else abs(float(wrap(off))) / turn_rate
        length = 0.0
        for (a, b), course in zip(itertools.pairwise(discs), courses, strict=True):
            length += math.dist(a.at(course), b.at(course))
        self.time = time + length / speed  # driving and turning, as fast as ahead [s]

    @cached_property
    def rows(self) -> Array:
        """(K, 4) x, y, course, and the number of the disc that a point lies on."""
        rows, course = list[tuple[float, float, float, int]](), self._begin
        for number, (disc, turn) in enumerate(zip(self.discs, self._turns, strict=True)):
            pieces = 1 + int(turn / arc_step(disc.radius)) if turn > 0.0 else 0
            for piece in range(pieces + 1):
                at = course + disc.sense * turn * (piece / max(pieces, 1))
                rows.append((*disc.at(at), at, number))
            course += disc.sense * turn
            if number + 1 < len(self.discs):
                course += float(wrap(self._courses[number] - course))
        return np.array(rows)

    @property
    def path(self) -> GeometricPath:
        """Points, headings and time."""
        return GeometricPath(self.rows[:, :2], self.rows[:, 2], self.time, self._reverse)


class TautStrings:
    """Strings around the same discs in one gear, each with other turns at start and goal.

    `request`: start, goal, speeds. `around`: what is in the way. `line`: from start to goal.
    `reverse`: whether they are driven backwards.
    """

    def __init__(
        self, request: PathRequest, around: Surroundings, line: Line, reverse: bool
    ) -> None:
        self._request, self._around, self._reverse = request, around, reverse
        self._corners, self._contacts = line.corners, list(line.contacts)
        self._straight = straight(request, line.corners, reverse)
        apart = math.dist(request.start[:2], request.goal[:2])
        radius = min(TURNING_RADIUS_SHARE * apart, TURNING_RADIUS_LIMIT)
        firsts, lasts = (_beside(pose, reverse, radius) for pose in (request.start, request.goal))
        if request.known is not None and any(request.known.blind_turns):
            del firsts[1:]  # it turns on the spot to look before it drives there
        self._ends = list(itertools.product(firsts, lasts))
        self._rounds = 0
        self._lay()

    def _lay(self) -> None:
        """Lay the quickest string around the contacts."""
        self._best: String | None = None
        discs = [contact.disc for contact in sorted(self._contacts)]
        for ends in self._ends:
            string = laid(self._request, [ends[0], *discs, ends[1]], self._reverse)
            if string is not None and string.time < (self._best or self._straight).time:
                self._best, self._chosen = string, ends

    @property
    def time(self) -> float:
        """Of the quickest one, as fast as ahead [s]; around more it takes longer."""
        return (self._best or self._straight).time

    def freed(self) -> GeometricPath | None:
        """Give the quickest one as a path if it is free; else it leads around more from now on.

        Where none is free, the line is driven straight from corner to corner.
        """
        string = self._best
        if string is None:
            return self._straight
        places, pieces = self._around.cut(string.rows[:, :2])
        if not len(places):
            return string.path
        barred = self._rounds >= ROUNDS
        self._rounds += 1
        for place, piece in zip(places, pieces, strict=True):
            contact = self._around.contact(place, self._corners)
            beside = {string.discs[int(number)] for number in string.rows[piece : piece + 2, 3]}
            barred |= contact.disc in beside  # it lies around that already
            if any(contact.disc == other.disc for other in self._contacts):
                # once more, behind what stands out of it
                contact = contact._replace(along=beside_line(place, self._corners)[0])
            self._contacts.append(contact)
        if barred:
            self._ends.remove(self._chosen)
        self._lay()
        return None


def _beside(pose: Array, reverse: bool, radius: float) -> list[Disc]:
    """Discs by which a string may leave or enter a pose (3,): its point, or one beside it."""
    x, y, heading = pose.tolist()
    heading += math.pi * reverse
    left, up = -radius * math.sin(heading), radius * math.cos(heading)
    beside = (Disc(x + s * left, y + s * up, radius, s) for s in (1.0, -1.0))
    return [Disc(x, y, 0.0, 0.0), *beside]


def laid(request: PathRequest, discs: list[Disc], reverse: bool) -> String | None:
    """Lay a string around discs, but for those that it lies not around; None if it cannot."""
    while True:
        chain = _untangled(discs)
        if chain is None:
            return None
        courses = [_course(a, b) for a, b in itertools.pairwise(chain)]
        turns = [
            (disc.sense * (after - before) - LONG_WAY) % math.tau + LONG_WAY
            for disc, before, after in zip(chain[1:-1], courses[:-1], courses[1:], strict=True)
        ]
        if not turns or min(turns) >= 0.0:
            return String(request, chain, courses, reverse)
        del chain[1 + turns.index(min(turns))]
        discs = chain


def straight(request: PathRequest, points: Array, reverse: bool) -> GeometricPath:
    """A path straight from corner to corner (K, 2), with turns on the spot."""
    speed, turn_rate = request.forward.tolist()
    steps, gear = np.diff(points, axis=0), math.pi * reverse
    start, goal = request.start[2] - gear, request.goal[2] - gear
    directions = np.arctan2(steps[:, 1], steps[:, 0])
    directions = np.where(np.abs(steps).max(axis=1) > ROUNDING, directions, start)
    turns = wrap(np.diff(directions, prepend=start))
    headings = start + np.cumsum(turns)
    turned = np.abs(turns).sum() + abs(wrap(goal - headings[-1]))
    time = float(np.hypot(steps[:, 0], steps[:, 1]).sum()) / speed + turned / turn_rate
    ends = np.stack([points[:-1], points[1:]], axis=1).reshape(-1, 2)
    return GeometricPath(ends, np.repeat(headings, 2), float(time), reverse)


def _turn_on(turn: float) -> float:
    """A turn [rad] on a disc: never the other way round, and none where it is rounding."""
    turn %= math.tau
    return 0.0 if turn > WHOLE_TURN else turn


def _course(a: Disc, b: Disc) -> float:
    """Direction of the line that leaves one disc and touches the next [rad]."""
    apart = math.hypot(b.x - a.x, b.y - a.y)
    beside = (b.sense * b.radius - a.sense * a.radius) / apart
    return math.atan2(b.y - a.y, b.x - a.x) - math.asin(beside)


def _untangled(chain: list[Disc]) -> list[Disc] | None:
    """Discs that have a common tangent with their neighbours; None if start or goal has none.

    Of two on one side of which one covers the other the larger one counts; two on either side that
    overlap leave a passage that is too narrow, and the string leads through its middle.
    """
    chain, i, last = list(chain), 0, len(chain) - 1
    while i < last:
        a, b = chain[i], chain[i + 1]
        apart = math.hypot(b.x - a.x, b.y - a.y)
        if abs(b.sense * b.radius - a.sense * a.radius) < apart * FULL:
            i += 1
            continue
        smaller = i if a.radius < b.radius else i + 1
        if i == 0 and i + 1 == last:
            return None
        if a.sense * b.sense < 0.0 and apart > ROUNDING:
            if i == 0 or i + 1 == last:
                return None
            share = apart * FULL**2 / (a.radius + b.radius)
            chain[i : i + 2] = (disc._replace(radius=share * disc.radius) for disc in (a, b))
            i = max(i - 1, 0)
            continue
        if smaller in (0, last):
            return None
        del chain[smaller]
        last -= 1
        i = max(i - 1, 0)
    return chain


def arc_step(radius: float) -> float:
    """Turn between two points of an arc [rad], so that its chords cut the circle as allowed.

    The larger the radius [m], the deeper a chord of the same turn cuts: by radius * turn^2 / 8.
    """
    # a little less than allowed, so that rounding does not make it more
    depth = (1.0 - 1e-6) * CUT_DEPTH
    if radius * (1.0 - math.cos(0.5 * ARC_STEP)) <= depth:
        return ARC_STEP
    return 2.0 * math.acos(1.0 - depth / radius)
