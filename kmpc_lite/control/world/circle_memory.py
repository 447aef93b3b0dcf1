"""Circles that were told when they were near, and are out of reach now: they still stand there.

Where only what lies within `NavigationProblem.sensor_range` is told, a circle is missing for one of
two reasons. Within reach it has gone, and is forgotten at once. Out of reach it is remembered, or
the robot would turn back from it, forget it, and come again.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.kernels.clearance import SPREAD_RATE, VELOCITY, things_of
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.circles import COLUMNS
from kmpc_lite.control.world.tracks import pairs
from kmpc_lite.types import Array

SAME_PLACE = 0.01
"""A circle that is told so near to where it was is the same one [m]."""


@dataclass(slots=True)
class CircleMemoryState:
    """The circles that stand, in the order in which they were told first."""

    circles: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(K, 5)."""
    unseen: Array = field(default_factory=lambda: np.empty(0))
    """(K,) for how long each has not been told; zero of those of the last step."""


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
        state: CircleMemoryState,
        things: Array,
        pose: Array,
        noise: float,
        driven: float,
    ) -> Array:
        """Take in the circles of a step, and give all that are known.

        Parameters
        ----------
        state : CircleMemoryState
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
