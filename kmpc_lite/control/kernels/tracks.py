"""Circles that are followed: a Kalman filter of many at once, and which of them is seen as which.

A state is x, y, vx, vy and the turn rate of the velocity. Accelerations are white; a turn rate
fades to zero, since nothing turns for ever. What is seen is the position.

Sizes: M tracks, at most 200; N circles.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.types import Array

STATES = 5
STATE, COVARIANCE, GIVEN = slice(0, 5), slice(5, 30), slice(31, 33)
RADIUS, MOVING, SEEN, UNSEEN, WALKED, NUMBER, SOURCE = 30, 33, 34, 35, 36, 37, 38
COLUMNS = 39
"""Of a track: state (5), its covariance (5, 5) row by row, radius, velocity that was given (2),
whether it has another one, since when it is followed, for how long it is hidden, for how long scans
have shown it to leave its place, its number, and which sensor it is followed by."""
PLACES = 2
ITSELF = np.eye(STATES)


def follow(
    tracks: Array,
    circles: Array,
    sources: Array,
    dt: float,
    memory: float,
    acceleration: float,
    turning: float,
    noise: float,
    other: float,
    gate: float,
    chance: float,
) -> tuple[Array, NDArray[np.intp]]:
    """Bring tracks to the next period, with the circles that are seen then.

    Circles that are farther than the gate from where a track expects them may be its all the same
    if it turned round: then its velocity may be any of the same pace.

    Parameters
    ----------
    tracks : ndarray
        (M, 39).
    circles, sources : ndarray
        (N, 5) and (N,) which sensor sees each: a track is that of one sensor.
    dt : float
        Period [s].
    memory : float
        How long turns last [s].
    acceleration : float
        Standard deviation of accelerations along each axis [m/s^2].
    turning : float
        The same of turn rates [rad/s].
    noise : float
        The same of a position along each axis [m].
    other : float
        The same of the change of velocity of what turned round [m/s].
    gate, chance : float
        Squared Mahalanobis distances: of positions that are not a track's any more, and of
        velocities that differ from the given ones.

    Returns
    -------
    after : ndarray
        (M, 39).
    found : ndarray
        (N,) index of each circle's track; -1 for none.
    """
    after = tracks.copy()
    count, fading = len(tracks), math.exp(-dt / memory)
    states, covariances = predict(
        tracks[:, STATE], tracks[:, COVARIANCE].reshape(-1, STATES, STATES), dt, fading
    )
    pushed = acceleration**2 * np.array([[0.25 * dt**4, 0.5 * dt**3], [0.5 * dt**3, dt * dt]])
    aside = other**2 * np.array([[dt * dt, dt], [dt, 1.0]])
    turned = covariances.copy()
    for axis in (0, 1):
        own = np.ix_(range(count), (axis, axis + 2), (axis, axis + 2))
        covariances[own] += pushed
        turned[own] += pushed + aside
    rate = (1.0 - fading**2) * turning**2
    covariances[:, 4, 4] += rate
    turned[:, 4, 4] += rate
    seen, alike = circles[:, :PLACES], tracks[:, SOURCE, None] == sources
    steady, squares = _costs(states, covariances, seen, noise, gate)
    wide, _ = _costs(states, turned, seen, noise, gate)
    rows, columns = pairs(np.where(alike, np.minimum(steady, wide), np.inf))
    turns = rows[squares[rows, columns] > gate]
    covariances[turns] = turned[turns]
    moved = np.zeros(count, dtype=bool)
    moved[turns] = tracks[turns, MOVING] > 0.0
    states[rows], covariances[rows] = update(states[rows], covariances[rows], seen[columns], noise)
    after[:, STATE], after[:, COVARIANCE] = states, covariances.reshape(-1, STATES * STATES)
    after[:, SEEN] += dt
    after[:, UNSEEN] += dt
    after[rows, UNSEEN] = 0.0
    after[rows, RADIUS], after[rows, GIVEN] = circles[columns, 2], circles[columns, 3:]
    # two sightings may be two circles; one that turns on the spot moves on
    differ = (after[:, SEEN] > 1.5 * dt) & _differ(states, covariances, after[:, GIVEN], chance)
    after[:, MOVING] = moved | differ
    found = np.full(len(circles), -1, dtype=np.intp)
    found[columns] = rows
    return after, found


def predict(states: Array, covariances: Array, dt: float, fading: float) -> tuple[Array, Array]:
    """States (M, 5) and covariances (M, 5, 5) a period later, before anything pushes."""
    vx, vy, turn = states[:, 2], states[:, 3], states[:, 4]
    angle = dt * turn
    cos, sin = np.cos(angle), np.sin(angle)
    # along and across the velocity before, by how far the arc leads
    ahead = dt * _sinc(angle)
    aside = 0.5 * dt * angle * _sinc(0.5 * angle) ** 2
    after = np.empty_like(states)
    after[:, 0] = states[:, 0] + ahead * vx - aside * vy
    after[:, 1] = states[:, 1] + ahead * vy + aside * vx
    after[:, 2], after[:, 3] = cos * vx - sin * vy, sin * vx + cos * vy
    after[:, 4] = fading * turn
    change = np.zeros((len(states), STATES, STATES))
    change[:, 0, 0] = change[:, 1, 1] = 1.0
    change[:, 0, 2] = change[:, 1, 3] = ahead
    change[:, 0, 3], change[:, 1, 2] = -aside, aside
    change[:, 2, 2] = change[:, 3, 3] = cos
    change[:, 2, 3], change[:, 3, 2] = -sin, sin
    change[:, 2, 4], change[:, 3, 4] = -dt * after[:, 3], dt * after[:, 2]
    change[:, 0, 4], change[:, 1, 4] = 0.5 * dt * change[:, 2, 4], 0.5 * dt * change[:, 3, 4]
    change[:, 4, 4] = fading
    return after, change @ covariances @ change.transpose(0, 2, 1)


def update(states: Array, covariances: Array, seen: Array, noise: float) -> tuple[Array, Array]:
    """Take in the positions (M, 2) that were seen of the M states."""
    spread = covariances[:, :PLACES, :PLACES] + noise**2 * np.eye(PLACES)
    gains = covariances[:, :, :PLACES] @ _inverse(spread)[0]
    after = states + (gains @ (seen - states[:, :PLACES])[..., None])[..., 0]
    kept = np.empty((len(states), STATES, STATES))
    kept[:] = ITSELF
    kept[:, :, :PLACES] -= gains
    # Joseph's form: symmetric and positive whatever is rounded
    left = kept @ covariances @ kept.transpose(0, 2, 1)
    return after, left + noise**2 * (gains @ gains.transpose(0, 2, 1))


def pairs(costs: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows (P,) and columns (P,) of the assignment of least total cost.

    By shortest paths of reduced costs (the Hungarian method), row after row.

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
    if not can.any():
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    finite = costs[can]
    # to stay alone costs more than all the rest together
    alone = (float(np.ptp(finite)) + 1.0) * (len(costs) + 1)
    columns = _assigned(np.where(can, costs - finite.min(), np.inf), alone)
    rows = np.flatnonzero(columns < costs.shape[1])
    return rows, columns[rows]


def _assigned(costs: Array, alone: float) -> NDArray[np.intp]:
    """Column (M,) of each row at the least total cost (M, N); column N + i: row i stays alone."""
    count, width = costs.shape
    total = width + count
    of_row, row_of = np.full(count, -1, dtype=np.intp), np.full(total, -1, dtype=np.intp)
    row_price, column_price = np.empty(count), np.zeros(total)
    for row in range(count):
        # each takes its favourite that is left; most have one of their own
        favourite = int(costs[row].argmin())
        if not costs[row, favourite] <= alone:
            favourite = width + row
        row_price[row] = costs[row, favourite] if favourite < width else alone
        if row_of[favourite] < 0:
            of_row[row], row_of[favourite] = favourite, row
    for begin in np.flatnonzero(of_row < 0).tolist():
        shortest, before = np.full(total, np.inf), np.full(total, -1, dtype=np.intp)
        done, row, so_far, visited = np.zeros(total, dtype=bool), begin, 0.0, []
        while True:
            visited.append(row)
            found = np.full(total, np.inf)
            found[:width], found[width + row] = costs[row], alone
            found += so_far - row_price[row]
            found -= column_price
            better = ~done & (found < shortest)
            shortest[better], before[better] = found[better], row
            column = int(np.where(done, np.inf, shortest).argmin())
            so_far = shortest[column]
            done[column] = True
            if row_of[column] < 0:
                break
            row = int(row_of[column])
        row_price[begin] += so_far
        for other in visited[1:]:
            row_price[other] += so_far - shortest[of_row[other]]
        column_price[done] -= so_far - shortest[done]
        row = -1
        while row != begin:
            row = int(before[column])
            row_of[column] = row
            of_row[row], column = column, int(of_row[row])
    return of_row


def _costs(
    states: Array, covariances: Array, seen: Array, noise: float, gate: float
) -> tuple[Array, Array]:
    """Costs (M, N) of pairs with positions (N, 2), infinite beyond the gate, and their squares."""
    spread = covariances[:, :PLACES, :PLACES] + noise**2 * np.eye(PLACES)
    inverse, determinants = _inverse(spread)
    away = seen - states[:, None, :PLACES]
    squares = ((away @ inverse) * away).sum(axis=2)
    return np.where(squares <= gate, squares + np.log(determinants)[:, None], np.inf), squares


def _differ(states: Array, covariances: Array, given: Array, chance: float) -> NDArray[np.bool_]:
    """Whether (M,) velocities differ from the given ones (M, 2) by more than chance makes them."""
    change = states[:, 2:4] - given
    inverse, _ = _inverse(covariances[:, 2:4, 2:4])
    found: NDArray[np.bool_] = ((change[:, None] @ inverse)[:, 0] * change).sum(axis=1) > chance
    return found


def _sinc(angle: Array) -> Array:
    return np.asarray(np.sinc(angle / math.pi))


def _inverse(matrices: Array) -> tuple[Array, Array]:
    """Inverses (M, 2, 2) of symmetric matrices, and their determinants (M,)."""
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinants: Array = a * d - b * b
    inverse = np.empty_like(matrices)
    inverse[:, 0, 0], inverse[:, 1, 1] = d / determinants, a / determinants
    inverse[:, 0, 1] = inverse[:, 1, 0] = -b / determinants
    return inverse, determinants
