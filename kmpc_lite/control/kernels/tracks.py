"""Circles that are followed: a Kalman filter of many at once, and which of them is seen as which.

A state is x, y, vx, vy and the turn rate of the velocity. Accelerations are white; a turn rate
fades to zero, since nothing turns for ever. What is seen is the position.

Sizes: M tracks, at most 200; N circles.
"""

from __future__ import annotations

STATES = 5
STATE, COVARIANCE, GIVEN = slice(0, 5), slice(5, 30), slice(31, 33)
RADIUS, MOVING, SEEN, UNSEEN, WALKED, NUMBER, SOURCE = 30, 33, 34, 35, 36, 37, 38
COLUMNS = 39
"""Of a track: state (5), its covariance (5, 5) row by row, radius, velocity that was given (2),
whether it has another one, since when it is followed, for how long it is hidden, for how long scans
have shown it to leave its place, its number, and which sensor it is followed by."""
