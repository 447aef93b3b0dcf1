"""Whether circles move as they are told to: who is told to stand and walks is noticed.

As long as every circle is where its velocity says, to rounding, nothing is done. Else all are
followed (`tracker`) until they do as told again, and those that move otherwise get the velocity
that they were seen to have, and room for its uncertainty.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.options import TrackerOptions
from kmpc_lite.control.world.circles import some_move
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
    """

    def __init__(self, dt: float, options: TrackerOptions, radius: float, speed: float) -> None:
        self._dt, self._rounding = dt, ROUNDING * radius
        self._follower = Follower(dt, options, radius, speed)

    def forget(self, state: MotionWatchState) -> None:
        """Begin anew: circles that are seen from a pose that jumped have jumped, too."""
        state.last = state.tracks = None

    def see(self, state: MotionWatchState, circles: Array) -> tuple[Array, Array | None]:
        """Take in the circles of a step.

        Parameters
        ----------
        state : MotionWatchState
            Updated.
        circles : ndarray
            (M, 5) as told.

        Returns
        -------
        circles : ndarray
            (M, 5), the very same array where all do as told.
        spread : ndarray or None
            (M,) speeds at which each grows for what is not known of its velocity; None where all do
            as told.
        """
        last, state.last = state.last, circles
        as_told = last is None or self._as_told(last, circles)
        if state.tracks is None:
            if as_told or last is None:
                return circles, None
            state.tracks, _ = self._follower.follow(Tracks(), last)
        state.tracks, found = self._follower.follow(state.tracks, circles)
        tracks, options = state.tracks, self._follower.options
        moves = np.zeros(len(circles), dtype=bool)
        moves[found >= 0] = tracks.moving[found[found >= 0]]
        if not moves.any():
            state.calm = state.calm + self._dt if as_told else 0.0
            if state.calm > options.coast:
                state.tracks, state.calm = None, 0.0
            return circles, None
        state.calm = 0.0
        circles, followed = circles.copy(), found[moves]
        circles[moves, 3:] = tracks.states[followed, 2:4]
        spread = np.zeros(len(circles))
        spread[moves] = options.spread * tracks.velocity_deviations[followed]
        return circles, spread

    def _as_told(self, last: Array, circles: Array) -> bool:
        """Whether circles (M, 5) are where the last ones said that they would be."""
        if len(last) != len(circles):
            return False
        if circles.tobytes() == last.tobytes() and not some_move(circles):
            return True
        away = circles[:, :2] - last[:, :2]
        if some_move(last):
            away -= self._dt * last[:, 3:]
        return bool(np.abs(away).max() <= self._rounding)
