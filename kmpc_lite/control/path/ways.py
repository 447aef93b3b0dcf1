"""Whole ways between poses: the cheapest that is clear, by how far an outline stays off things."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.path.capabilities import seen_from
from kmpc_lite.control.path.motions import TINY, Motions, chained, moved, sampled
from kmpc_lite.control.path.planner import PathRequest, distances_around
from kmpc_lite.types import Array

NEAR = 1.0  # clearance beyond the margin below which driving costs more [radii]
NEAR_PRICE = 1.0  # what it costs more at the margin, as a share of its time
CHUNK = 4096  # places that are looked at at once: what it needs of memory
SHOTS, WAYS = 12, 3  # most ways that are looked at at once, and of these to one pose
FINE = 0.15  # how far what sticks out moves between two places at which a path is looked at [radii]
MOST_SAMPLES = 160  # most poses at which a way is looked at


class OutlineClearance:
    """Clearance of the circles of a request's outline.

    Start and goal may lie nearer to something than the margin allows: so near them the robot may
    come, no nearer.

    `request`: outline, obstacles and area. `margin`: what the problem keeps beyond the radii [m].
    """

    def __init__(self, request: PathRequest, margin: float) -> None:
        self._request, outline = request, request.outline
        self._least, self._kept = margin, 0.0
        ends = np.stack([request.start, request.goal])
        self._ends = ends[:, :2]
        self._radius = float(outline[:, 2].max())
        arms = np.hypot(outline[:, 0], outline[:, 1])
        self.arm = float(arms.max()) + self._radius  # how far the outline reaches [m]
        self._reach = 2.0 * self.arm
        self._room_at_ends = outline_distances(request, ends) - margin
        self._near = NEAR * self._radius

    def keep(self, clearance: float) -> None:
        """Keep so much more than the margin from now on, start and goal aside [m]."""
        self._kept = clearance

    def on_way(self, poses: Array) -> Array:
        """Clearance beyond the margin (n,) of a path's poses (n, 3), its ends aside [m]."""
        found = self.room(poses)
        away = [np.hypot(*(poses[:, :2] - end).T) > self._reach for end in self._ends]
        out: Array = np.where(away[0] & away[1], found, np.inf)
        return out if np.isfinite(out).any() else found

    def room(self, poses: Array) -> Array:
        """Clearance beyond the margin (n,) at poses (n, 3) [m]; infinite in the open."""
        out: Array = outline_distances(self._request, poses) - self._least
        return out

    def at(self, poses: Array) -> Array:
        """Clearance (n,) at poses (n, 3) beyond what must be kept there [m]; below zero outside."""
        found, less = self.room(poses) - self._kept, np.zeros(len(poses))
        for place, room in zip(self._ends, self._room_at_ends, strict=True):
            if (lack := self._kept - room) > 0.0:
                near = np.hypot(*(poses[:, :2] - place).T) <= self._reach
                less = np.maximum(less, np.where(near, lack + TINY, 0.0))
        found += less
        low, high = self._request.area
        inside = np.minimum(poses[:, :2] - low, high - poses[:, :2]).min(axis=1)
        found = np.where(inside >= -TINY, found, -1.0)
        return found

    def price(self, clearance: Array) -> Array:
        """How many times its time driving costs at a clearance beyond the margin (...)."""
        out: Array = 1.0 + NEAR_PRICE * np.clip(1.0 - clearance / self._near, 0.0, 1.0)
        return out


def outline_distances(request: PathRequest, poses: Array) -> Array:
    """Distances (n,) of a robot's outline at poses (n, 3) from what is around it [m]."""
    outline = request.outline
    if not len(poses):
        return np.empty(0)
    x, y, radii = outline.T
    if request.centre is not None:
        poses = seen_from(poses, -request.centre)
    cos, sin = np.cos(poses[:, 2:]), np.sin(poses[:, 2:])
    places = np.stack([poses[:, :1] + cos * x - sin * y, poses[:, 1:2] + sin * x + cos * y], -1)
    step = max(CHUNK // len(outline), 1)
    parts = [
        _distances(request, places[k : k + step].reshape(-1, 2), poses[k : k + step])
        for k in range(0, len(poses), step)
    ]
    found: Array = (np.concatenate(parts).reshape(len(poses), -1) - radii).min(axis=1)
    return found


def _distances(request: PathRequest, points: Array, poses: Array) -> Array:
    """Distances (n C,) of the circles' middles (n C, 2) at poses (n, 3) [m]."""
    footprint, solids, unit = request.footprint, request.solids, request.unit
    if footprint is None or solids is None:
        return request.distances(points)
    body = footprint.scaled(unit), poses / (unit, unit, 1.0)
    coarse = 0.0 if request.known is None else request.known.coarseness
    least = solids.whole.least(points / unit, body=body) * unit + coarse
    return np.minimum(least, distances_around(points, request.circles, None))


class Piece(NamedTuple):
    """Motions one after the other."""

    twists: Array  # (S, 3)
    times: Array  # (S,)

    def then(self, other: Piece) -> Piece:
        """Both, one after the other."""
        return Piece(*(np.concatenate(pair) for pair in zip(self, other, strict=True)))


class Line(NamedTuple):
    """A path while it is improved: its poses, what is driven from each, and the cost from there."""

    poses: Array  # (K, 3), the goal last
    costs: Array  # (K,) to the goal
    gears: Array  # (K,) of what is driven next, 0 at the goal
    ways: list[Piece]  # from each of the first K - 1 to the goal, one or more after the other


class Ways:
    """Finds ways between poses.

    `motions`: of the wheels. `clearance`: of the robot. `radius`: of its circles [m]. `gear_price`:
    what a change of gear costs [s]. `now`: gear in which the robot drives, 0 if it stands, and
    curvature of its wheels [1/m].
    """

    def __init__(
        self,
        motions: Motions,
        clearance: OutlineClearance,
        radius: float,
        gear_price: float,
        now: tuple[float, float],
    ) -> None:
        self._now: tuple[float, float | None] = now
        self._motions, self._clearance = motions, clearance
        self._radius, self._gear_price = radius, gear_price

    def ranked(
        self,
        start: Array,
        ends: Array,
        costs: Array,
        gears: Array,
        most: float,
        before: tuple[float, float | None],
    ) -> Iterator[tuple[float, Piece, int]]:
        """Give ways from a pose (3,) that cost less, the cheapest first, each by its end of n.

        They are clear at some places (`is_clear` looks at more).

        Ends (n, 3) cost so much more to the goal (n,), to which these gears (n,) lead. `before`:
        gear, 0 if none, and curvature, if known, in which the robot comes there.
        """
        twists, times = self._motions.connect(start, ends)
        fixed = costs[:, None] + self._switching(twists, times, gears, before)
        prices = fixed + times.sum(axis=-1)
        # of each end the best ones, and of these the cheapest
        each = np.argsort(prices, axis=1, kind="stable")[:, :WAYS]
        ranked = np.take_along_axis(prices, each, axis=1)
        order = np.argsort(ranked, axis=None, kind="stable")[:SHOTS]
        order = order[ranked.ravel()[order] < most]
        if not len(order):
            return
        rows = order // each.shape[1]
        columns = each.ravel()[order]
        twists, times = twists[rows, columns], times[rows, columns]
        total = fixed[rows, columns] + self._times_near(start, twists, times)
        for best in np.argsort(total, kind="stable")[: int((total < most).sum())].tolist():
            yield float(total[best]), Piece(twists[best], times[best]), int(rows[best])

    def is_clear(self, start: Array, way: Piece) -> bool:
        """Whether all that is driven from a pose (3,) is, at places near to each other."""
        twists, times = (part[way.times > TINY] for part in way)
        lengths = (np.hypot(*twists.T[:2]) + self._clearance.arm * np.abs(twists[:, 2])) * times
        counts = np.ceil(lengths / (FINE * self._radius)).astype(np.intp)
        poses, _ = sampled(start, twists, times, np.maximum(counts, 1))
        return bool((self._clearance.at(poses) >= -TINY).all())

    def _switching(
        self, twists: Array, times: Array, after: Array, before: tuple[float, float | None]
    ) -> Array:
        """What changes of gear, and steering, cost on ways (n, W, S, 3) (n, W) [s]."""
        gear, curvature = before
        changes = self._gear_price * self._changes(twists, times, after, gear)
        out: Array = changes + self._motions.steering_times(twists, times, curvature)
        return out

    def _changes(self, twists: Array, times: Array, after: Array, before: float) -> Array:
        """Changes of gear (n, W) on ways (n, W, S, 3), from one before, into those after (n,)."""
        if not self._motions.gears.any():
            return np.zeros(times.shape[:-1])
        # a motion that takes no time has no gear: that of the one before goes on
        gears = np.sign(twists[..., 0]) * (times > TINY)
        changes, gear = np.zeros(times.shape[:-1]), np.full(times.shape[:-1], before)
        for k in range(gears.shape[-1]):
            changes += gear * gears[..., k] < 0.0
            gear = np.where(gears[..., k] != 0.0, gears[..., k], gear)
        out: Array = changes + (gear * after[:, None] < 0.0)
        return out

    def _times_near(self, start: Array, twists: Array, times: Array) -> Array:
        """Times (n,) of ways (n, S, 3), longer near obstacles; infinite of those not clear."""
        lasts = times.sum(axis=1)
        fastest = np.hypot(twists[..., 0], twists[..., 1]) + self._radius * np.abs(twists[..., 2])
        longest = float((fastest * times).sum(axis=1).max())
        count = int(np.clip(math.ceil(longest / (0.4 * self._radius)), 2, MOST_SAMPLES))
        when = (np.arange(count) + 1.0) / count * lasts[:, None]
        ends = np.cumsum(times, axis=1)
        piece = np.minimum((when[..., None] > ends[:, None] + TINY).sum(axis=2), times.shape[1] - 1)
        begins, row = chained(start, twists, times), np.arange(len(times))[:, None]
        after = when - (ends - times)[row, piece]
        poses = moved(begins[row, piece], twists[row, piece], after)
        kept = self._clearance.at(poses.reshape(-1, 3)).reshape(when.shape)
        priced = lasts * self._clearance.price(kept).mean(axis=1)
        return np.where(kept.min(axis=1) >= 0.0, priced, np.inf)

    def improve(self, line: Line, k: int) -> None:
        """Look for a better way from one pose of a path to one of those after it."""
        following = k + 1
        # what it costs as it is, since what follows may have become cheaper
        way, gear = line.ways[k], line.gears[following : following + 1]
        lasts = self._times_near(line.poses[k], way.twists[None], way.times[None])
        before = (0.0, None) if k else self._now
        switching = self._switching(way.twists[None, None], way.times[None, None], gear, before)
        now = float(line.costs[following] + lasts[0] + switching[0, 0])
        line.costs[k] = now = now if math.isfinite(now) else float(line.costs[k])
        after = slice(following, None)
        ends, costs, gears = line.poses[after], line.costs[after], line.gears[after]
        for price, other, row in self.ranked(line.poses[k], ends, costs, gears, now - TINY, before):
            if self.is_clear(line.poses[k], other):
                line.costs[k], way, following = price, other, following + row
                break
        if following < len(line.ways):
            way = way.then(line.ways[following])
        line.ways[k] = way
        line.gears[k] = self._gear_of(way)

    def _gear_of(self, way: Piece) -> float:
        """Gear in which a way begins; 0 of wheels without."""
        drives = (way.times > TINY) & (way.twists[:, 0] != 0.0)
        if not self._motions.gears.any() or not drives.any():
            return 0.0
        return float(np.sign(way.twists[drives.argmax(), 0]))
