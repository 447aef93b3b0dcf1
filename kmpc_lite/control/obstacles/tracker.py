"""Follows circles from step to step: which one is which, and how fast each moves.

A circle that comes from a camera, a lidar or a list without velocities stands for the controller,
though it may walk. The tracker predicts where each circle should be, pairs what is seen with what
is expected, and corrects (`track_filter`). What is hidden for a while is taken to go on.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.obstacles.circles import Circle, circles_to_array
from kmpc_lite.control.obstacles.pairing import pairs
from kmpc_lite.control.obstacles.track_filter import STATES, TrackFilter, moving
from kmpc_lite.control.options.fields import in_metres
from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.errors import ProblemError
from kmpc_lite.scale import UNIT_RADIUS, UNIT_SPEED
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
        return _worst_axis(self.covariances[:, :2, :2])

    @property
    def velocity_deviations(self) -> Array:
        """(M,) standard deviation of the velocity along its worst axis [m/s]."""
        return _worst_axis(self.covariances[:, 2:4, 2:4])


class ObstacleTracker:
    """Gives circles the velocity that they were seen to have.

    Parameters
    ----------
    dt : float
        Time between two updates [s].
    options : TrackerOptions, optional
        Noise of the sensor, accelerations, gate, how long a hidden circle is remembered.
    radius, speed : float
        Of the robot that the options are multiples of [m, m/s].

    Attributes
    ----------
    tracks : Tracks
        What is followed, with its uncertainty. A copy of it, assigned later, goes back to then.

    Raises
    ------
    ProblemError
        For a period, radius or speed that is none.

    Examples
    --------
    >>> tracker = ObstacleTracker(0.1)
    >>> for k in range(6):
    ...     seen = tracker.update([Circle(0.05 * k, 1.0, 0.2), Circle(2.0, 0.0, 0.2)])
    >>> [(round(c.vx, 2), round(c.vy, 2)) for c in seen]
    [(0.5, 0.0), (0.0, 0.0)]
    """

    def __init__(
        self,
        dt: float,
        options: TrackerOptions | None = None,
        radius: float = UNIT_RADIUS,
        speed: float = UNIT_SPEED,
    ) -> None:
        for name, value in (("dt", dt), ("radius", radius), ("speed", speed)):
            if not (math.isfinite(value) and value > 0.0):
                raise ProblemError(f"{name}: expected a number > 0, got {value!r}")
        self.dt, self.options = dt, in_metres(options or TrackerOptions(), radius)
        options = self.options
        self._filter = TrackFilter(dt, options, speed)
        # of two degrees of freedom
        self._gate = -2.0 * math.log(options.gate)
        self._chance = -2.0 * math.log(options.false_alarm)
        self.tracks = Tracks()

    def reset(self) -> None:
        """Forget all circles."""
        self.tracks = Tracks()

    def update(self, circles: Sequence[Circle] | ArrayLike) -> list[Circle]:
        """Take in the circles of a period.

        Parameters
        ----------
        circles : sequence of Circle, or array_like
            Where they are now, in any order; an array has rows x, y, radius or x, y, radius, vx,
            vy. A velocity that is told is kept until the circle is seen to have another one.

        Returns
        -------
        list of Circle
            The same circles in the same order, with velocities; then those that are hidden, where
            they should be. To be handed to `Controller.step`.

        Raises
        ------
        ValueError
            For other shapes, or values that are not finite.
        """
        array = circles_to_array(circles)
        if not np.isfinite(array).all():
            raise ValueError("circles: expected finite numbers")
        followed = self.follow(array)
        tracks = self.tracks
        hidden = np.flatnonzero(tracks.unseen > 0.0)
        velocities = tracks.velocities
        known = followed >= 0
        array = array.copy()
        array[known, 3:] = velocities[followed[known]]
        rest = np.hstack(
            [tracks.states[hidden, :2], tracks.radii[hidden, None], velocities[hidden]]
        )
        return [Circle(*row) for row in np.vstack([array, rest]).tolist()]

    def follow(self, circles: Array) -> Array:
        """Take in circles (N, 5); give the index of each one's track (N,), -1 for too many."""
        tracks = self.tracks
        states, covariances = self._filter.predict(tracks.states, tracks.covariances)
        rows, columns = self._pairs(states, covariances, circles)
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
        states = np.concatenate([states[alive], first])
        covariances = np.concatenate([covariances[alive], uncertain])
        self.tracks = Tracks(
            states,
            covariances,
            np.concatenate([radii[alive], circles[new, 2]]),
            told,
            moving(states, covariances, told, self._chance),
            np.concatenate([tracks.numbers[alive], numbers]),
            np.concatenate([seen[alive], none]),
            np.concatenate([unseen[alive], none]),
            tracks.next_number + len(new),
        )
        return found

    def _pairs(self, states: Array, covariances: Array, circles: Array) -> tuple[Array, Array]:
        """Which track (P,) was seen as which circle (P,): the likeliest pairs within the gate."""
        squares, spread = self._filter.distances(states, covariances, circles[:, :2])
        return pairs(np.where(squares <= self._gate, squares + spread[:, None], np.inf))


def _worst_axis(covariances: Array) -> Array:
    """Standard deviations (M,) along the worst axes of covariances (M, 2, 2)."""
    out: Array = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances)[:, -1], 0.0))
    return out
