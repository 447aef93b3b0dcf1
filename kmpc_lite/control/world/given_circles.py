"""Circles as given, what was seen of them before, and those that are out of reach.

As long as every circle is where its velocity says, to rounding, nothing is done. Else all are
followed (`tracks`) until they do as given again, and those that move otherwise get the velocity
that they were seen to have, and room for its uncertainty.

Where only what lies within `NavigationProblem.sensor_range` is given, a circle is missing for one
of two reasons. Within reach it has gone, and is forgotten at once. Out of reach it is remembered,
or the robot would turn back from it, forget it, and come again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.kernels.clearance import (
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
    some_move,
    things_of,
)
from kmpc_lite.control.options import ControllerOptions, TrackerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.circles import COLUMNS
from kmpc_lite.control.world.tracks import Follower, Tracks, pairs
from kmpc_lite.types import Array

ROUNDING = 1e-6
"""How far from its place a circle may be that moves as given: single precision [radii]."""
SAME_PLACE = 0.01
"""A circle that is given so near to where it was is the same one [m]."""


@dataclass(slots=True)
class GivenCircles:
    """The circles of the last step, what is followed, and what stands out of reach."""

    last: Array | None = None
    """(M, 5) as they were given."""
    tracks: Tracks | None = None
    """None as long as all do as they are given."""
    circles: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(K, 5) that stand, in the order in which they were given first; none without
    `sensor_range`."""
    unseen: Array = field(default_factory=lambda: np.empty(0))
    """(K,) for how long each has not been given; zero of those of the last step."""


class MotionWatch:
    """Compares circles with what was told of them.

    Parameters
    ----------
    dt : float
        Period.
    options : TrackerOptions
        When they count as moving.
    radius, speed : float
        Of the robot, which the options are multiples of.
    spread_max : float
        How far what moves spreads at the most.
    """

    def __init__(
        self, dt: float, options: TrackerOptions, radius: float, speed: float, spread_max: float
    ) -> None:
        self._spread_max = spread_max
        self._dt, self._rounding = dt, ROUNDING * radius
        self._follower = Follower(dt, options, radius, speed)

    def forget(self, state: GivenCircles) -> None:
        """Begin anew: circles that are seen from a pose that jumped have jumped, too."""
        state.last = state.tracks = None

    def see(self, state: GivenCircles, things: Array) -> Array:
        """Take in the circles of a step.

        Parameters
        ----------
        state : GivenCircles
            Updated.
        things : ndarray
            (M, 7) as given.

        Returns
        -------
        ndarray
            (M, 7), the very same array where all do as given; those that do not have the velocity
            that they were seen to have, and spread by what is not known of it.
        """
        circles = things[:, :SPREAD_RATE]
        last, state.last = state.last, circles
        as_told = last is None or self._as_told(last, circles)
        if state.tracks is None:
            if as_told or last is None:
                return things
            state.tracks, _ = self._follower.follow(Tracks(), last)
        state.tracks, found = self._follower.follow(state.tracks, circles)
        tracks, options = state.tracks, self._follower.options
        moves = np.zeros(len(circles), dtype=bool)
        moves[found >= 0] = tracks.moving[found[found >= 0]]
        if not moves.any():
            if as_told:
                state.tracks = None
            return things
        things, followed = things.copy(), found[moves]
        things[moves, VELOCITY] = tracks.states[followed, 2:4]
        things[moves, SPREAD_RATE] = options.spread * tracks.velocity_deviations[followed]
        things[moves, SPREAD_MAX] = self._spread_max
        return things

    def _as_told(self, last: Array, circles: Array) -> bool:
        """Whether circles (M, 5) are where the last ones said that they would be."""
        if len(last) != len(circles):
            return False
        if circles.tobytes() == last.tobytes() and not some_move(circles):
            return True
        away = circles[:, :2] - last[:, :2]
        if some_move(last):
            away -= self._dt * last[:, VELOCITY]
        return bool(np.abs(away).max() <= self._rounding)


class CircleMemory:
    """Adds the circles that are out of reach to those that are told.

    Parameters
    ----------
    problem : NavigationProblem
        Its `sensor_range`, radius and period, in the robot's units.
    options : ControllerOptions
        How long circles are remembered, and how many there may be.
    """

    def __init__(self, problem: NavigationProblem, options: ControllerOptions) -> None:
        self._range = problem.sensor_range
        self._radius, self._dt = problem.body_radius, problem.dt
        self._memory, self._most = options.sight.memory, options.obstacles.circles

    def recall(
        self,
        state: GivenCircles,
        things: Array,
        pose: Array,
        noise: float,
        driven: float,
    ) -> Array:
        """Take in the circles of a step, and give all that are known.

        Parameters
        ----------
        state : GivenCircles
            Updated; left alone where there is no `sensor_range`.
        things : ndarray
            (M, 7) as given, or as seen to move.
        pose : ndarray
            (3,) from which they were seen.
        noise : float
            By how much poses may err.
        driven : float
            How far the robot drives in a period, by which the list may be older than the pose.

        Returns
        -------
        ndarray
            (K + W, 7): all that stand, always in the same order so that a list that shrinks is no
            other map, then those that move.
        """
        if self._range is None or not (len(things) or len(state.circles)):
            return things
        circles = things[:, :SPREAD_RATE]
        stands = (things[:, VELOCITY] == 0.0).all(axis=1) & (things[:, SPREAD_RATE] == 0.0)
        known, unseen = state.circles.copy(), state.unseen + self._dt
        rows, columns = self._told_again(known, circles, noise)
        known[rows], unseen[rows] = circles[columns], 0.0
        is_new = stands.copy()
        is_new[columns] = False
        away = np.hypot(known[:, 0] - pose[0], known[:, 1] - pose[1])
        reach = self._range - SAME_PLACE - noise - driven
        kept = (away - known[:, 2] - self._radius > reach) & (unseen <= self._memory)
        kept[rows] = stands[columns]
        self._keep_latest(kept, unseen, self._most - len(circles))
        state.circles = np.concatenate([known[kept], circles[is_new]])
        state.unseen = np.concatenate([unseen[kept], np.zeros(np.count_nonzero(is_new))])
        return np.concatenate([things_of(state.circles), things[~stands]])

    def _told_again(self, known: Array, circles: Array, noise: float) -> tuple[Array, Array]:
        """Which of those that are known (K, 5) is which of the told ones (M, 5): pairs of rows."""
        differ = np.zeros((len(known), len(circles)))
        for axis in range(3):
            away = np.abs(np.subtract.outer(known[:, axis], circles[:, axis]))
            np.maximum(differ, away, out=differ)
        differ[differ > SAME_PLACE + noise] = np.inf
        return pairs(differ)

    def _keep_latest(self, kept: Array, unseen: Array, most: int) -> None:
        """Of the kept ones (K,) that were not told forget those beyond a number, the oldest."""
        remembered = np.flatnonzero(kept & (unseen > 0.0))
        if len(remembered) > most:
            order = np.argsort(unseen[remembered], kind="stable")
            kept[remembered[order[max(most, 0) :]]] = False
