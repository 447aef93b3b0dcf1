"""Circles that are followed, and how a period's circles are added to them.

What is expected is predicted, paired with what is seen, and corrected (`track_filter`). What is
hidden for a while is taken to go on.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields

import numpy as np

from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.control.world.track_filter import STATES, TrackFilter, moving, worst_axis
from kmpc_lite.option_fields import lengths_from_radii
from kmpc_lite.types import Array

GATE = 1e-4
"""Probability that a circle is farther from where its track expects it than is looked."""
MOST = 200
"""Circles that are followed."""


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
    """(M,) for how long scans have shown each to leave the place where it was [s]; less again where
    nothing has told of it lately."""
    next_number: int = 0
    """Of the next track."""

    def __len__(self) -> int:
        return len(self.states)

    def take(self, chosen: Array) -> Tracks:
        """Those (M,) that are chosen."""
        rows = {name: getattr(self, name)[chosen] for name in ARRAYS}
        return Tracks(**rows, next_number=self.next_number)

    def joined_by(self, others: Tracks) -> Tracks:
        """These, and then the others."""
        rows = {n: np.concatenate([getattr(self, n), getattr(others, n)]) for n in ARRAYS}
        return Tracks(**rows, next_number=others.next_number)

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


ARRAYS = [f.name for f in fields(Tracks) if f.name != "next_number"]
"""What has a row for each track."""


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

        self.dt, self.radius = dt, radius
        self.options = lengths_from_radii(options, radius)
        self._filter = TrackFilter(dt, self.options, speed)
        # of two degrees of freedom
        self._gate = -2.0 * math.log(GATE)
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
        # who turns on the spot moves on
        moved = np.zeros(len(tracks), dtype=bool)
        moved[turned] = tracks.moving[turned]
        after = Tracks(
            states,
            covariances,
            radii,
            told,
            moved,
            tracks.numbers,
            seen,
            unseen,
            tracks.walked,
            tracks.next_number,
        )
        found = np.full(len(circles), -1)
        found[columns] = rows
        alive = unseen <= np.minimum(self.options.coast, seen - unseen)
        if not alive.all():
            found[columns] = (np.cumsum(alive) - 1)[rows]
            after = after.take(alive)
        if len(columns) < len(circles):
            new = np.flatnonzero(found < 0)[: max(MOST - len(after), 0)]
            found[new] = len(after) + np.arange(len(new))
            after = after.joined_by(self._begin(circles[new], after.next_number))
        # two sightings may be two circles
        followed = after.seen > 1.5 * self.dt
        differ = moving(after.states, after.covariances, after.told, self._chance)
        after.moving = after.moving | (followed & differ)
        return after, found

    def _begin(self, circles: Array, number: int) -> Tracks:
        """Tracks of circles (N, 5) that are seen for the first time."""
        states, covariances = self._filter.first(circles[:, :2], circles[:, 3:])
        count, none = len(circles), np.zeros(len(circles))
        return Tracks(
            states,
            covariances,
            circles[:, 2],
            circles[:, 3:],
            np.zeros(count, dtype=bool),
            number + np.arange(count),
            none,
            none,
            none,
            number + count,
        )

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


def pairs(costs: Array) -> tuple[Array, Array]:
    """Rows (P,) and columns (P,) of the assignment of least total cost.

    Parameters
    ----------
    costs : ndarray
        (M, N), infinite for pairs that cannot be; as many pairs as possible are chosen.

    Examples
    --------
    >>> rows, columns = pairs(np.array([[1.0, 2.0], [1.5, np.inf]]))
    >>> rows.tolist(), columns.tolist()
    ([0, 1], [1, 0])
    """
    can = np.isfinite(costs)
    rows, columns = np.flatnonzero(can.any(axis=1)), np.flatnonzero(can.any(axis=0))
    left = costs[np.ix_(rows, columns)]
    if not left.size:
        return rows[:0], columns[:0]
    nearest = left.argmin(axis=1)
    if np.bincount(nearest).max() == 1:
        # each has a favourite of its own: nothing is cheaper
        return rows, columns[nearest]
    # here, for it takes time to import: `Follower` does so where it is made
    from scipy.optimize import linear_sum_assignment

    possible = np.isfinite(left)
    finite = left[possible]
    # what cannot be costs more than all the rest together
    refused = (float(np.ptp(finite)) + 1.0) * (len(left) + 1)
    first, second = linear_sum_assignment(np.where(possible, left - finite.min(), refused))
    chosen = possible[first, second]
    return rows[first[chosen]], columns[second[chosen]]
