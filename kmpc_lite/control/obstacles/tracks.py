"""Circles that are followed, and how a period's circles are added to them.

What is expected is predicted, paired with what is seen, and corrected (`track_filter`). What is
hidden for a while is taken to go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.obstacles.pairing import pairs
from kmpc_lite.control.obstacles.track_filter import STATES, TrackFilter, moving, worst_axis
from kmpc_lite.control.options.fields import in_metres
from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.types import Array


@dataclass(slots=True)
class Tracks:
    """Circles that are followed, M of them: data, which copies and pickles."""

    states: Array = field(default_factory=lambda: np.empty((0, STATES)))
    """(M, 5) x, y [m], vx, vy [m/s], turn rate of the velocity [rad/s]."""
    covariances: Array = field(default_factory=lambda: np.empty((0, STATES, STATES)))
    """(M, 5, 5) of these: how uncertain position and velocity are."""
    radii: Array = field(default_factory=lambda: np.empty(0))
    """(M,) as seen last [m]."""
    told: Array = field(default_factory=lambda: np.empty((0, 2)))
    """(M, 2) velocities that the circles were given with [m/s]; zero where none was."""
    moving: Array = field(default_factory=lambda: np.empty(0, dtype=bool))
    """(M,) whether the velocity is another one than told, beyond chance."""
    numbers: Array = field(default_factory=lambda: np.empty(0, dtype=int))
    """(M,) name of each track, for as long as it lasts."""
    seen: Array = field(default_factory=lambda: np.empty(0))
    """(M,) since when each is followed [s]."""
    unseen: Array = field(default_factory=lambda: np.empty(0))
    """(M,) for how long each is hidden [s]."""
    walked: Array = field(default_factory=lambda: np.empty(0))
    """(M,) for how long scans have shown each to leave the place where it was [s]."""
    next_number: int = 0
    """Of the next track."""

    def __len__(self) -> int:
        return len(self.states)

    @property
    def velocities(self) -> Array:
        """(M, 2) as seen where a circle moves otherwise than told, else as told [m/s]."""
        out: Array = np.where(self.moving[:, None], self.states[:, 2:4], self.told)
        return out

    @property
    def position_deviations(self) -> Array:
        """(M,) standard deviation of the position along its worst axis [m]."""
        return worst_axis(self.covariances[:, :2, :2])

    @property
    def velocity_deviations(self) -> Array:
        """(M,) standard deviation of the velocity along its worst axis [m/s]."""
        return worst_axis(self.covariances[:, 2:4, 2:4])


class Follower:
    """Brings tracks from period to period; it remembers nothing itself.

    Parameters
    ----------
    dt : float
        Period [s].
    options : TrackerOptions
        In radii and shares of the fastest speed.
    radius, speed : float
        Of the robot that the options are multiples of [m, m/s].
    """

    def __init__(self, dt: float, options: TrackerOptions, radius: float, speed: float) -> None:
        import scipy.optimize  # noqa: F401  # pairs are found by it: no step has time to import it

        self.dt, self.options = dt, in_metres(options, radius)
        self._filter = TrackFilter(dt, self.options, speed)
        # of two degrees of freedom
        self._gate = -2.0 * math.log(options.gate)
        self._chance = -2.0 * math.log(options.false_alarm)

    def follow(self, tracks: Tracks, circles: Array) -> tuple[Tracks, Array]:
        """Take in circles (N, 5).

        Returns
        -------
        tracks : Tracks
            A period later.
        found : ndarray
            (N,) index of each circle's track; -1 for those that are too many.
        """
        states, covariances = self._filter.predict(tracks.states, tracks.covariances)
        rows, columns, turned, covariances = self._pairs(states, covariances, circles)
        if len(rows):
            states[rows], covariances[rows] = self._filter.update(
                states[rows], covariances[rows], circles[columns, :2]
            )
        unseen, seen = tracks.unseen + self.dt, tracks.seen + self.dt
        unseen[rows] = 0.0
        radii, told = tracks.radii.copy(), tracks.told.copy()
        radii[rows], told[rows] = circles[columns, 2], circles[columns, 3:]
        alive = unseen <= np.minimum(self.options.coast, seen - unseen)
        place = np.full(len(states), -1)
        place[alive] = np.arange(np.count_nonzero(alive))
        found = np.full(len(circles), -1)
        found[columns] = place[rows]
        kept = np.count_nonzero(alive)
        new = np.flatnonzero(found < 0)[: max(self.options.most - kept, 0)]
        found[new] = kept + np.arange(len(new))
        first, uncertain = self._filter.first(circles[new, :2], circles[new, 3:])
        none, numbers = np.zeros(len(new)), tracks.next_number + np.arange(len(new))
        told = np.concatenate([told[alive], circles[new, 3:]])
        seen = np.concatenate([seen[alive], none])
        # two sightings may be two circles
        followed = seen > 1.5 * self.dt
        # who turns on the spot moves on
        moved = np.zeros(len(tracks), dtype=bool)
        moved[turned] = tracks.moving[turned]
        moved = np.concatenate([moved[alive], np.zeros(len(new), dtype=bool)])
        states = np.concatenate([states[alive], first])
        covariances = np.concatenate([covariances[alive], uncertain])
        after = Tracks(
            states,
            covariances,
            np.concatenate([radii[alive], circles[new, 2]]),
            told,
            moved | (followed & moving(states, covariances, told, self._chance)),
            np.concatenate([tracks.numbers[alive], numbers]),
            seen,
            np.concatenate([unseen[alive], none]),
            np.concatenate([tracks.walked[alive], none]),
            tracks.next_number + len(new),
        )
        return after, found

    def _pairs(
        self, states: Array, covariances: Array, circles: Array
    ) -> tuple[Array, Array, Array, Array]:
        """Which track (P,) was seen as which circle (P,): the likeliest pairs within the gate.

        Then tracks (T,) that can be paired only if they turned round; covariances (M, 5, 5) are
        larger for those.
        """
        squares, spread = self._filter.distances(states, covariances, circles[:, :2])
        wide = self._filter.turned_round(covariances)
        wide_squares, wide_spread = self._filter.distances(states, wide, circles[:, :2])
        steady = np.where(squares <= self._gate, squares + spread[:, None], np.inf)
        turned = np.where(wide_squares <= self._gate, wide_squares + wide_spread[:, None], np.inf)
        rows, columns = pairs(np.minimum(steady, turned))
        turns = rows[squares[rows, columns] > self._gate]
        covariances = covariances.copy()
        covariances[turns] = wide[turns]
        return rows, columns, turns, covariances
