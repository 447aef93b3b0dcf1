"""Circles that are followed, as a table, and what comes and goes in it from period to period.

Those who walk are found in scans: small clusters that are followed from step to step and move.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels import tracks as rows_of
from kmpc_lite.control.kernels.records import SPREAD_RATE, things_of
from kmpc_lite.control.kernels.tracks import WALKED
from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world.scan import LaserScan, beams
from kmpc_lite.geometry import rotate
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.local_map import LocalMap

GATE = 1e-4  # probability that a circle is farther from where its track expects it than is looked
MOST = 200  # circles that are followed
FIRST_SPEED = 2.0
"""Standard deviation of the velocity of what was never seen before, along each axis, as a share of
the robot's fastest: it may be anything."""
TURN_MEMORY = 2.0  # how long turns last [s]
TURN_RATE = 0.5
"""Standard deviation of turn rates [rad/s]: a person walks a half circle in six seconds."""
GIVEN, SCANNED = 0.0, 1.0  # whether a circle was given, or is a cluster of a scan
GAP = 1.0  # distance between neighbouring hits beyond which another cluster begins [radii]
LARGEST = 3.0  # radius of the largest cluster that may be a pedestrian [radii]
WINDOW = 1.0
"""Time over which a cluster's way counts [s]: one that stands for so long is a thing
again."""
SURE = 3.0  # how many times as much a step counts that leads to where it was seen to be free
STRAYED = 0.5
"""How far a cluster must have moved to be a pedestrian, in its own radii: what is seen of a post
changes with the place that it is seen from."""
BEHIND = 1.5
"""How far behind its middle a cluster must have been free, too, in cells: a wall is none."""


@dataclass(slots=True)
class Tracks:
    """Circles that are followed, M of them: data, which copies and pickles."""

    rows: Array = field(default_factory=lambda: np.empty((0, rows_of.COLUMNS)))
    """(M, 39) as of `kernels.tracks`."""
    next_number: int = 0  # of the next track

    def __len__(self) -> int:
        return len(self.rows)

    def take(self, chosen: Array) -> Tracks:
        """Those (M,) that are chosen."""
        return Tracks(self.rows[chosen], self.next_number)

    @property
    def states(self) -> Array:
        """(M, 5) x, y [m], vx, vy [m/s], turn rate of the velocity [rad/s]."""
        return self.rows[:, rows_of.STATE]

    @property
    def covariances(self) -> Array:
        """(M, 5, 5) of these: how uncertain position and velocity are."""
        states = rows_of.STATES
        return self.rows[:, rows_of.COVARIANCE].reshape(-1, states, states)

    @property
    def circles(self) -> Array:
        """(M, 5) where they are, with the velocities that they were seen to have."""
        return self.rows[:, [0, 1, rows_of.RADIUS, 2, 3]]

    @property
    def radii(self) -> Array:
        """(M,) as seen last [m]."""
        return self.rows[:, rows_of.RADIUS]

    @property
    def moving(self) -> NDArray[np.bool_]:
        """(M,) whether the velocity is another one than given, beyond chance."""
        return np.greater(self.rows[:, rows_of.MOVING], 0.0)

    @property
    def numbers(self) -> NDArray[np.intp]:
        """(M,) name of each track, for as long as it lasts."""
        return self.rows[:, rows_of.NUMBER].astype(np.intp)

    @property
    def seen(self) -> Array:
        """(M,) since when each is followed [s]."""
        return self.rows[:, rows_of.SEEN]

    @property
    def unseen(self) -> Array:
        """(M,) for how long each is hidden [s]."""
        return self.rows[:, rows_of.UNSEEN]

    @property
    def walked(self) -> Array:
        """(M,) for how long scans have shown each to leave its place [s].

        Less again if nothing has told of it lately.
        """
        return self.rows[:, rows_of.WALKED]

    @property
    def scanned(self) -> NDArray[np.bool_]:
        """(M,) whether each is a cluster of a scan."""
        return np.equal(self.rows[:, rows_of.SOURCE], SCANNED)

    @property
    def velocities(self) -> Array:
        """(M, 2) as seen where a circle moves otherwise than given, else as given [m/s]."""
        given = self.rows[:, rows_of.GIVEN]
        out: Array = np.where(self.moving[:, None], self.states[:, 2:4], given)
        return out

    @property
    def velocity_deviations(self) -> Array:
        """(M,) standard deviation of the velocity along its worst axis [m/s]."""
        of = self.covariances
        a, b, d = of[:, 2, 2], of[:, 2, 3], of[:, 3, 3]
        return np.asarray(np.sqrt(0.5 * (a + d) + np.hypot(0.5 * (a - d), b)))


@dataclass(slots=True)
class TrackedCircles:
    """The circles of the last step, and what is followed."""

    things: Array | None = None
    """(K, 7) as given or seen to move, with those that stand out of reach; None before the first
    step."""
    unseen: Array = field(default_factory=lambda: np.empty(0))
    """(K,) for how long each has not been given."""
    tracks: Tracks = field(default_factory=Tracks)
    """Of clusters of scans, and of given circles if one does otherwise than given."""

    def pose_jumped(self) -> None:
        """Forget what moves: what is seen from a pose that has jumped has jumped, too."""
        self.tracks = Tracks()
        if self.things is not None:
            kept = stand(self.things)
            self.things, self.unseen = self.things[kept], self.unseen[kept]


class Follower:
    """Brings tracks from period to period; it remembers nothing itself.

    `dt`: period [s]. `options`: in radii and shares of the fastest speed. `radius`, `speed`: of the
    robot that the options are multiples of [m, m/s]. `spread_max`: how far what moves spreads at
    the most [m].
    """

    def __init__(
        self,
        dt: float,
        options: TrackerOptions,
        radius: float,
        speed: float,
        spread_max: float = math.inf,
    ) -> None:
        self.dt, self.radius, self._spread_max = dt, radius, spread_max
        self.options = options = lengths_from_radii(options, radius)
        # chance: of two degrees of freedom; what turned round keeps its pace, the other way
        chances = -2.0 * math.log(GATE), -2.0 * math.log(options.false_alarm)
        motion = options.acceleration * speed, TURN_RATE
        self.numbers = dt, TURN_MEMORY, *motion, options.noise, 0.5 * FIRST_SPEED * speed, *chances
        """What `kernels.tracks.follow` is told of period, motion and sensor."""
        own = options.noise**2, (FIRST_SPEED * speed) ** 2
        self._first = np.diag([own[0], own[0], own[1], own[1], TURN_RATE**2])

    def follow(
        self, tracks: Tracks, circles: Array, sources: Array | float = GIVEN
    ) -> tuple[Tracks, Array]:
        """Take in circles (N, 5), given or seen in scans as sources (N,) say.

        Returns `tracks`: a period later; `found`: (N,) index of each circle's track; -1 for those
        that are too many.
        """
        sources = np.broadcast_to(sources, len(circles))
        rows, found = library.follow(tracks.rows, circles, sources, *self.numbers)
        unseen, seen = rows[:, rows_of.UNSEEN], rows[:, rows_of.SEEN]
        alive = unseen <= np.minimum(self.options.coast, seen - unseen)
        if not alive.all():
            found = np.where(found >= 0, (np.cumsum(alive) - 1)[found], -1)
            rows = rows[alive]
        new = np.flatnonzero(found < 0)[: max(MOST - len(rows), 0)]
        after = Tracks(rows, tracks.next_number)
        if len(new):
            found[new] = len(rows) + np.arange(len(new))
            after = self.begin(after, circles[new], sources[new])
        return after, found

    def begin(self, tracks: Tracks, circles: Array, sources: Array | float) -> Tracks:
        """Tracks, and those of circles (N, 5) that are seen for the first time."""
        rows, number = np.zeros((len(circles), rows_of.COLUMNS)), tracks.next_number
        rows[:, :4] = circles[:, [0, 1, 3, 4]]
        rows[:, rows_of.COVARIANCE] = self._first.ravel()
        rows[:, rows_of.RADIUS], rows[:, rows_of.GIVEN] = circles[:, 2], circles[:, 3:]
        rows[:, rows_of.NUMBER] = number + np.arange(len(circles))
        rows[:, rows_of.SOURCE] = sources
        return Tracks(np.concatenate([tracks.rows, rows]), number + len(circles))

    def things(self, tracks: Tracks) -> Array:
        """Things (M, 7) that move as they were seen to, and spread by what is not known of it."""
        spread = self.options.spread * tracks.velocity_deviations
        return things_of(tracks.circles, spread, self._spread_max)


def stand(things: Array) -> NDArray[np.bool_]:
    """Which things (M, 7) are given to stand, and were not seen to move."""
    return np.logical_not(things[:, [3, 4, SPREAD_RATE]].any(axis=1))


def clusters(scan: LaserScan, pose: Array, robot: float, largest: float = LARGEST) -> Array:
    """Circles (N, 5) at rest of the small things that stand free in a scan (`kernels.clusters`).

    `scan`: seen from the pose. `pose`: of the robot (3,). `robot`: its radius [m]. `largest`:
    largest radius of a cluster [radii].
    """
    sizes = abs(scan.angle_increment), GAP * robot, largest * robot
    mount = np.array(scan.mount[:2])
    found = library.clusters(scan.reach, scan.ends, scan.hits, scan.clear, mount, *sizes)
    circles = np.zeros((len(found), 5))
    x, y = rotate(found[:, 0], found[:, 1], float(pose[2]))
    circles[:, 0], circles[:, 1], circles[:, 2] = x + pose[0], y + pose[1], found[:, 2]
    return circles


def walking_tracks(
    tracks: Tracks,
    follower: Follower,
    scans: Sequence[LaserScan],
    poses: Sequence[Array],
    was_free: Callable[[Array], NDArray[np.bool_]] | None = None,
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Find the tracks that walk, in scans that were taken at poses (3,).

    A pedestrian that walks has left its place: that is seen to be free, or hidden behind it. What
    is seen of a wall also seems to move as the robot does, but the wall is still there, and mostly
    nothing was free where it seems to come to, as `was_free` says of places (M, 2). A pedestrian
    counts as walking until nothing has confirmed it for a window: two that walk side by side, or
    past each other, are one cluster for a while. One that comes to where it was free may walk
    though it is not seen to leave a place: another follows it, or it is near and hides it.

    Returns `known`: (W,) indices of tracks that walk; `perhaps`: (P,) of those that have left their
    place, but not for long enough to be sure, or only come to where it was free.
    """
    dt, begins, moving = follower.dt, follower.options.begins, tracks.moving
    gap = GAP * follower.radius
    knew = tracks.walked >= begins
    if not (moving | knew).any():
        tracks.rows[:, WALKED] = 0.0
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    rows = tracks.circles
    velocities, radii = rows[:, 3:], rows[:, 2]
    lasted = np.minimum(tracks.seen - tracks.unseen, WINDOW)
    moved = np.hypot(*velocities.T) * lasted > STRAYED * radii
    is_seen = tracks.unseen == 0.0
    walks = moving & moved
    comes = np.zeros(len(tracks), dtype=bool)
    here, faster = np.flatnonzero(walks & is_seen), np.full(len(tracks), SURE)
    if len(here):
        before = rows[here, :2] - lasted[here, None] * velocities[here]
        left = [
            _has_left(scan, pose, rows[here], before, gap)
            for scan, pose in zip(scans, poses, strict=True)
        ]
        walks[here] = np.any(left, axis=0)
        if was_free is not None:
            # it may walk over what was seen of itself
            comes[here] = was_free(rows[here, :2])
            faster[here] = np.where(comes[here], SURE, 1.0)
    # a hidden pedestrian walks on for as long as it was seen to
    longer = np.minimum(tracks.walked + faster * dt, begins + WINDOW)
    times = np.where(is_seen, longer, tracks.walked)
    times = np.where(walks, times, np.where(knew, tracks.walked - dt, 0.0))
    tracks.rows[:, WALKED] = times
    known = (times >= begins) & (tracks.unseen <= times)
    perhaps = (walks | comes) & is_seen & ~known
    return np.flatnonzero(known), np.flatnonzero(perhaps)


def _has_left(
    scan: LaserScan, pose: Array, rows: Array, before: Array, gap: float
) -> NDArray[np.bool_]:
    """Whether a scan shows the places (M, 2) where circles (M, 5) were to be left."""
    told = np.flatnonzero(~scan.unknown)
    if not len(told):
        return np.zeros(len(rows), dtype=bool)
    heading, away = float(pose[2]), before - pose[:2]
    x, y = rotate(away[:, 0], away[:, 1], -heading)
    x, y = x - scan.mount[0], y - scan.mount[1]
    along = beams(*scan.layout)[1].take(told, axis=0)
    beam = told[(along @ np.stack([x, y])).argmax(axis=0)]
    distance = np.hypot(x, y)
    passed = scan.reach[beam] > distance + rows[:, 2]
    # one that comes nearer hides where it was: the beam ends at it, well before that place
    ends = scan.ends[beam]
    ends = np.stack(rotate(ends[:, 0], ends[:, 1], heading), axis=1) + pose[:2]
    at_itself = np.hypot(*(ends - rows[:, :2]).T) < rows[:, 2] + gap
    way = np.hypot(*(rows[:, :2] - before).T)
    well_before = scan.reach[beam] < distance - rows[:, 2] - 0.5 * way
    found: NDArray[np.bool_] = passed | (at_itself & well_before)
    return found


def was_free(before: LocalMap | None, places: Array, robot: Array) -> NDArray[np.bool_]:
    """Whether cells at places (M, 2), and behind them as seen from the robot, were seen free.

    A pedestrian that comes nearer hides where its middle is: the cells there were free until it was
    seen in front of them, which is no longer than a window ago.
    """
    if before is None:
        return np.zeros(len(places), dtype=bool)
    away = places - robot
    away *= BEHIND * before.cell / np.maximum(np.hypot(*away.T), before.cell)[:, None]
    cells, inside = before.cells_of(np.concatenate([places, places + away]))
    free = inside & before.was_free(cells, WINDOW)
    return free[: len(places)] & free[len(places) :]
