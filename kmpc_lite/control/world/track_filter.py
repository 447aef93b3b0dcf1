"""Kalman filter of many circles at once: constant velocity that turns.

A state is x, y [m], vx, vy [m/s] and the turn rate of the velocity [rad/s]. Accelerations are
white; a turn rate fades to zero, since nobody turns for ever. All functions take M states (M, 5)
and their covariances (M, 5, 5), and return new ones.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.types import Array

STATES = 5
SEEN = 2
"""How many of them are seen: the position."""
ITSELF = np.eye(STATES)
FIRST_SPEED = 2.0
"""Standard deviation of the velocity of what was never seen before, along each axis, as a share of
the robot's fastest: it may be anything."""
TURN_RATE = 0.5
"""Standard deviation of turn rates [rad/s]: a person walks a half circle in six seconds."""
TURN_MEMORY = 2.0
"""How long turns last [s]."""


class TrackFilter:
    """The filter of one period.

    Parameters
    ----------
    dt : float
        Period [s].
    options : TrackerOptions
        Noise and motion; lengths in metres.
    fastest : float
        Speed that options are shares of [m/s].
    """

    def __init__(self, dt: float, options: TrackerOptions, fastest: float) -> None:
        self.dt = dt
        self._fading = math.exp(-dt / TURN_MEMORY)
        pushed = np.array([0.5 * dt * dt, dt])
        spread = (options.acceleration * fastest) ** 2 * np.outer(pushed, pushed)
        self._motion = np.zeros((STATES, STATES))
        for axis in (0, 1):
            self._motion[axis::SEEN, axis::SEEN][:2, :2] = spread
        self._motion[4] = self._motion[:, 4] = 0.0
        self._motion[4, 4] = (1.0 - self._fading**2) * TURN_RATE**2
        self._noise = options.noise**2 * np.eye(SEEN)
        speed = (FIRST_SPEED * fastest) ** 2
        # at the same pace, the other way
        other = 0.5 * FIRST_SPEED * fastest
        self._turned = np.zeros((STATES, STATES))
        for axis in (0, 1):
            self._turned[axis, axis] = (dt * other) ** 2
            self._turned[axis + 2, axis + 2] = other**2
            self._turned[axis, axis + 2] = self._turned[axis + 2, axis] = dt * other**2
        seen = options.noise**2
        self._first = np.diag([seen, seen, speed, speed, TURN_RATE**2])

    def first(self, positions: Array, velocities: Array) -> tuple[Array, Array]:
        """States and covariances of what is seen for the first time, at (M, 2) with (M, 2)."""
        count = len(positions)
        states = np.hstack([positions, velocities, np.zeros((count, 1))])
        return states, np.tile(self._first, (count, 1, 1))

    def turned_round(self, covariances: Array) -> Array:
        """Covariances (M, 5, 5) of a period in which everybody may have changed his velocity."""
        found: Array = covariances + self._turned
        return found

    def predict(self, states: Array, covariances: Array) -> tuple[Array, Array]:
        """One period later."""
        dt, count = self.dt, len(states)
        vx, vy, turn = states[:, 2], states[:, 3], states[:, 4]
        angle = dt * turn
        cos, sin = np.cos(angle), np.sin(angle)
        # along and across the velocity before, by how far the arc leads
        ahead = dt * np.sinc(angle / math.pi)
        aside = 0.5 * dt * angle * np.sinc(angle / (2.0 * math.pi)) ** 2
        after = np.empty_like(states)
        after[:, 0] = states[:, 0] + ahead * vx - aside * vy
        after[:, 1] = states[:, 1] + ahead * vy + aside * vx
        after[:, 2], after[:, 3] = cos * vx - sin * vy, sin * vx + cos * vy
        after[:, 4] = self._fading * turn
        change = np.zeros((count, STATES, STATES))
        change[:, 0, 0] = change[:, 1, 1] = 1.0
        change[:, 0, 2] = change[:, 1, 3] = ahead
        change[:, 0, 3], change[:, 1, 2] = -aside, aside
        change[:, 2, 2] = change[:, 3, 3] = cos
        change[:, 2, 3], change[:, 3, 2] = -sin, sin
        change[:, 2, 4], change[:, 3, 4] = -dt * after[:, 3], dt * after[:, 2]
        change[:, 0, 4], change[:, 1, 4] = 0.5 * dt * change[:, 2, 4], 0.5 * dt * change[:, 3, 4]
        change[:, 4, 4] = self._fading
        return after, change @ covariances @ change.transpose(0, 2, 1) + self._motion

    def distances(self, states: Array, covariances: Array, seen: Array) -> tuple[Array, Array]:
        """Squared Mahalanobis distances (M, N) of positions (N, 2), and log determinants (M,)."""
        spread = covariances[:, :SEEN, :SEEN] + self._noise
        away = seen - states[:, None, :SEEN]
        inverse, determinants = _inverse(spread)
        squares = ((away @ inverse) * away).sum(axis=2)
        return squares, np.log(determinants)

    def update(self, states: Array, covariances: Array, seen: Array) -> tuple[Array, Array]:
        """Take in the positions (M, 2) that were seen of the M states."""
        spread = covariances[:, :SEEN, :SEEN] + self._noise
        gains = covariances[:, :, :SEEN] @ _inverse(spread)[0]
        after = states + (gains @ (seen - states[:, :SEEN])[..., None])[..., 0]
        kept = np.empty((len(states), STATES, STATES))
        kept[:] = ITSELF
        kept[:, :, :SEEN] -= gains
        # Joseph's form: symmetric and positive whatever is rounded
        left = kept @ covariances @ kept.transpose(0, 2, 1)
        return after, left + gains @ self._noise @ gains.transpose(0, 2, 1)


def moving(states: Array, covariances: Array, velocities: Array, limit: float) -> Array:
    """Whether (M,) velocities differ from the given ones (M, 2) by more than chance makes them.

    Parameters
    ----------
    states, covariances : ndarray
        (M, 5) and (M, 5, 5).
    velocities : ndarray
        What they are compared with (M, 2) [m/s].
    limit : float
        Squared Mahalanobis distance beyond which they differ.
    """
    change = states[:, 2:4] - velocities
    inverse, _ = _inverse(covariances[:, 2:4, 2:4])
    differ: Array = ((change[:, None] @ inverse)[:, 0] * change).sum(axis=1) > limit
    return differ


def worst_axis(covariances: Array) -> Array:
    """Standard deviations (M,) along the worst axes of covariances (M, 2, 2)."""
    a, b, d = covariances[:, 0, 0], covariances[:, 0, 1], covariances[:, 1, 1]
    out: Array = np.sqrt(0.5 * (a + d) + np.hypot(0.5 * (a - d), b))
    return out


def _inverse(matrices: Array) -> tuple[Array, Array]:
    """Inverses (M, 2, 2) of symmetric matrices, and their determinants (M,)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinants: Array = a * d - b * b
    inverse = np.empty_like(matrices)
    inverse[:, 0, 0], inverse[:, 1, 1] = d / determinants, a / determinants
    inverse[:, 0, 1] = inverse[:, 1, 0] = -b / determinants
    return inverse, determinants
