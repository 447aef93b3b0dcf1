"""Circles that are followed, as a table, and what comes and goes in it from period to period."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import scan_library
from kmpc_lite.control.kernels import tracks as rows_of
from kmpc_lite.control.kernels.clearance import SPREAD_RATE, things_of
from kmpc_lite.control.options.sight import TrackerOptions
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

GATE = 1e-4
"""Probability that a circle is farther from where its track expects it than is looked."""
MOST = 200
"""Circles that are followed."""
FIRST_SPEED = 2.0
"""Standard deviation of the velocity of what was never seen before, along each axis, as a share of
the robot's fastest: it may be anything."""
TURN_MEMORY = 2.0
"""How long turns last [s]."""
TURN_RATE = 0.5
"""Standard deviation of turn rates [rad/s]: a person walks a half circle in six seconds."""
GIVEN, SCANNED = 0.0, 1.0
"""Whether a circle was given, or is a cluster of a scan."""


@dataclass(slots=True)
class Tracks:
    """Circles that are followed, M of them: data, which copies and pickles."""

    rows: Array = field(default_factory=lambda: np.empty((0, rows_of.COLUMNS)))
    """(M, 39) as of `kernels.tracks`."""
    next_number: int = 0
    """Of the next track."""

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
        return _worst_axis(self.covariances[:, 2:4, 2:4])


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
        rows, found = scan_library.follow(tracks.rows, circles, sources, *self.numbers)
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


def _worst_axis(covariances: Array) -> Array:
    """Standard deviations (M,) along the worst axes of covariances (M, 2, 2)."""
    a, b, d = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    out: Array = np.sqrt(0.5 * (a + d) + np.hypot(0.5 * (a - d), b))
    return out
