"""Whether circles move as they are told to: who is told to stand and walks is noticed.

As long as every circle is where its velocity says, to rounding, nothing is done. Else all are
followed (`tracker`) until they do as told again, and those that move otherwise get the velocity
that they were seen to have, and room for its uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.kernels.clearance import (
    SPREAD_MAX,
    SPREAD_RATE,
    VELOCITY,
    some_move,
)
from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world.tracks import Follower, Tracks
from kmpc_lite.types import Array

ROUNDING = 1e-6
"""How far from its place a circle may be that moves as told: single precision [radii]."""


@dataclass(slots=True)
class MotionWatchState:
    """The circles of the last step, and what is followed."""

    last: Array | None = None
    """(M, 5) as they were told."""
    tracks: Tracks | None = None
    """None as long as all do as they are told."""
    calm: float = 0.0
    """For how long all have done as told again."""


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

    def forget(self, state: MotionWatchState) -> None:
        """Begin anew: circles that are seen from a pose that jumped have jumped, too."""
        state.last = state.tracks = None

    def see(self, state: MotionWatchState, things: Array) -> Array:
        """Take in the circles of a step.

        Parameters
        ----------
        state : MotionWatchState
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
            state.calm = state.calm + self._dt if as_told else 0.0
            if state.calm > options.coast:
                state.tracks, state.calm = None, 0.0
            return things
        state.calm = 0.0
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
