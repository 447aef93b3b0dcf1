"""Naive references of the kernels in C for scans and circles that are followed, by NumPy."""

import math

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.optimize import linear_sum_assignment

from kmpc_lite.control.kernels.tracks import (
    COVARIANCE,
    GIVEN,
    MOVING,
    RADIUS,
    SEEN,
    SOURCE,
    STATE,
    STATES,
    UNSEEN,
)
from kmpc_lite.control.world.local_map import window_between
from kmpc_lite.control.world.scan import numbers_of

FEWEST, PLACES = 3, 2
ITSELF = np.eye(STATES)
NEIGHBOURS, SAME_SURFACE, INDEPENDENT = 8, 3.0, 2


def clusters(reach, ends, hits, clear, mount, step, gap, largest):
    told = np.flatnonzero(hits | clear)
    count = len(told)
    if count < FEWEST + 2:
        return np.empty((0, 3))
    ring, hit, far = ends.take(told, axis=0), hits.take(told), reach.take(told)
    # from each to the next one, and from the last to the first
    following = np.roll(np.arange(count), -1)
    away = ring.take(following, axis=0) - ring
    together = hit & hit.take(following)
    together &= np.hypot(away[:, 0], away[:, 1]) <= gap
    # a cluster lies between two gaps of the ring; the one behind the first gap comes first
    gaps = np.flatnonzero(~together)
    begins, last = (gaps + 1) % count, np.concatenate([gaps[1:], gaps[:1]])
    chosen = hit.take(begins) & ((last - begins) % count + 1 >= FEWEST)
    chosen &= _extents(ring, gaps) <= 2.0 * largest
    first, last = begins[chosen], last[chosen]
    # what ends at the scanner's reach goes on beyond it
    free = far.take(first - 1) > far.take(first) + gap
    free &= far.take((last + 1) % count) > far.take(last) + gap
    first, last = first[free], last[free]
    begin, end = ring.take(first, axis=0), ring.take(last, axis=0)
    # the outermost beams that hit miss the sides by half a step each
    chords = np.hypot(end[:, 0] - begin[:, 0], end[:, 1] - begin[:, 1])
    radii = 0.5 * (chords + step * np.minimum(far.take(first), far.take(last)))
    small = radii <= largest
    radii, chords = radii[small], chords[small]
    middle = 0.5 * (begin + end)[small] - mount
    # the chord lies before the centre
    beyond = np.sqrt(np.maximum(radii**2 - 0.25 * chords**2, 0.0))
    beyond /= np.maximum(np.hypot(middle[:, 0], middle[:, 1]), radii)
    return np.column_stack([middle * (1.0 + beyond)[:, None] + mount, radii])


def _extents(ring, gaps):
    if not len(gaps):
        return np.empty(0)
    ring = np.roll(ring, -1 - gaps[0], axis=0)
    begins = gaps - gaps[0]
    sides = np.maximum.reduceat(ring, begins) - np.minimum.reduceat(ring, begins)
    return sides.max(axis=1)


def follow(tracks, circles, sources, dt, memory, acceleration, turning, noise, other, gate, chance):
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


def predict(states, covariances, dt, fading):
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


def update(states, covariances, seen, noise):
    spread = covariances[:, :PLACES, :PLACES] + noise**2 * np.eye(PLACES)
    gains = covariances[:, :, :PLACES] @ _inverse(spread)[0]
    after = states + (gains @ (seen - states[:, :PLACES])[..., None])[..., 0]
    kept = np.empty((len(states), STATES, STATES))
    kept[:] = ITSELF
    kept[:, :, :PLACES] -= gains
    # Joseph's form: symmetric and positive whatever is rounded
    left = kept @ covariances @ kept.transpose(0, 2, 1)
    return after, left + noise**2 * (gains @ gains.transpose(0, 2, 1))


def _costs(states, covariances, seen, noise, gate):
    spread = covariances[:, :PLACES, :PLACES] + noise**2 * np.eye(PLACES)
    inverse, determinants = _inverse(spread)
    away = seen - states[:, None, :PLACES]
    squares = ((away @ inverse) * away).sum(axis=2)
    return np.where(squares <= gate, squares + np.log(determinants)[:, None], np.inf), squares


def _differ(states, covariances, given, chance):
    change = states[:, 2:4] - given
    inverse, _ = _inverse(covariances[:, 2:4, 2:4])
    return ((change[:, None] @ inverse)[:, 0] * change).sum(axis=1) > chance


def _sinc(angle):
    return np.asarray(np.sinc(angle / math.pi))


def _inverse(matrices):
    a, b, d = matrices[:, 0, 0], matrices[:, 0, 1], matrices[:, 1, 1]
    determinants = a * d - b * b
    inverse = np.empty_like(matrices)
    inverse[:, 0, 0], inverse[:, 1, 1] = d / determinants, a / determinants
    inverse[:, 0, 1] = inverse[:, 1, 0] = -b / determinants
    return inverse, determinants


def told_beams(ranges, along, counts, mount, least, most, own):
    clear = counts & ((ranges == np.inf) | (ranges == most))
    hits = counts & (ranges >= least) & (ranges > 0.0) & (ranges < most)
    reach = np.where(hits, ranges, np.where(clear, most, 0.0))
    ends = reach[:, None] * along + mount
    if own > 0.0:
        inside = hits & (np.hypot(ends[:, 0], ends[:, 1]) <= own)
        if inside.any():
            hits &= ~inside
            reach[inside], ends[inside] = 0.0, mount
    return hits, clear, reach, ends


def averaged_ranges(ranges, hits, step, noise, half):
    known = np.full(len(ranges) + 2 * NEIGHBOURS, np.inf, dtype=np.float32)
    known[NEIGHBOURS:-NEIGHBOURS] = np.where(hits, ranges, np.inf)
    own = np.where(hits, ranges, 0.0).astype(np.float32)
    away = sliding_window_view(known, 2 * NEIGHBOURS + 1) - own[:, None]
    beams = np.abs(np.arange(-NEIGHBOURS, NEIGHBOURS + 1, dtype=np.float32))
    same = np.abs(away) <= np.float32(SAME_SURFACE * noise)
    same &= beams * np.float32(step) * own[:, None] <= np.float32(half)
    away[~same] = 0.0
    counts = np.maximum(np.count_nonzero(same, axis=1), 1)
    deviations = noise / np.sqrt(np.minimum(counts, INDEPENDENT))
    return ranges + away.sum(axis=1) / counts, deviations


def pass_rays(
    state, seen, extent, place, low, high, origin, turn, squares, distance, farther, clock
):
    (x, y), shape = origin, (state.shape[0], state.shape[1])
    near_low = max(low[0], x - distance), max(low[1], y - distance)
    near_high = min(high[0], x + distance), min(high[1], y + distance)
    near = window_between(near_low, near_high, place, shape)
    see_through(state, seen, extent, near, place, origin, turn, squares, clock, False)
    if not farther:
        return
    (top, bottom, left, right), far = near, window_between(low, high, place, shape)
    sides = [far]
    if top < bottom and left < right:
        first, last, begin, end = far
        sides = [(first, top, begin, end), (bottom, last, begin, end)]
        sides += [(top, bottom, begin, left), (top, bottom, right, end)]
    for side in sides:
        see_through(state, seen, extent, side, place, origin, turn, squares, clock, True)


def see_through(state, seen, extent, window, place, origin, turn, squares, clock, only_hit):
    top, bottom, left, right = window
    cell, first_column, first_row = place
    if only_hit:
        rows, columns = np.nonzero(state[top:bottom, left:right] > 0)
        rows, columns = rows + top, columns + left
        box = extent[rows, columns].astype(np.float64)
        low_x, low_y = (columns + first_column) * cell, (rows + first_row) * cell
        hit_x = 0.5 * ((low_x + box[:, 0]) + (low_x + box[:, 2]))
        hit_y = 0.5 * ((low_y + box[:, 1]) + (low_y + box[:, 3]))
        gone = _passed(hit_x, hit_y, origin, turn, squares)
        state[rows[gone], columns[gone]] -= 1
        return
    part, times = state[top:bottom, left:right], seen[top:bottom, left:right]
    x = cell * (first_column + 0.5 + np.arange(left, right))
    y = cell * (first_row + 0.5 + np.arange(top, bottom))
    passed = _passed(x[None], y[:, None], origin, turn, squares)
    np.copyto(part, np.maximum(part - 1, 0), where=passed)
    np.maximum(times, passed * np.float32(clock), out=times)


def _passed(x, y, origin, turn, squares):
    # single precision is a micrometre here, and half the time
    right = (x - origin[0]).astype(np.float32)
    up = (y - origin[1]).astype(np.float32)
    cos, sin = np.float32(turn[0]), np.float32(turn[1])
    ahead, aside = cos * right + sin * up, cos * up - sin * right
    reached = squares.take(numbers_of(ahead, aside), mode="clip")
    return reached >= right * right + up * up


def mark(state, seen, extent, taken, points, errors, place, level, clock):
    cell, first_column, first_row = place
    height, width = state.shape
    whole = np.floor(points / cell)
    column, row = whole[:, 0] - first_column, whole[:, 1] - first_row
    inside = (column >= 0) & (row >= 0) & (column < width) & (row < height)
    cells = (row[inside] * width + column[inside]).astype(np.intp)
    if not len(cells):
        return
    order = np.argsort(cells, kind="stable")
    cells, off = cells[order], errors[inside][order, None]
    places = (points[inside] - cell * whole[inside])[order]
    begins = np.flatnonzero(np.diff(cells, prepend=-1))
    cells = cells.take(begins)
    flat = state.ravel()
    taken.ravel()[cells[flat[cells] == 0]] = clock
    flat[cells] = level
    seen.ravel()[cells] = clock
    boxes = extent.reshape(-1, 4)
    boxes[cells, :2] = np.minimum.reduceat(places - off, begins)
    boxes[cells, 2:] = np.maximum.reduceat(places + off, begins)


def hit_boxes(state, extent, window, place):
    top, bottom, left, right = window
    rows, columns = np.nonzero(state[top:bottom, left:right] > 0)
    rows, columns = rows + top, columns + left
    cell, first_column, first_row = place
    corner = np.stack([(columns + first_column) * cell, (rows + first_row) * cell], axis=1)
    box = extent[rows, columns].astype(np.float64)
    return corner + box[:, :2], corner + box[:, 2:]


def rectangles(cells):
    height, width = cells.shape
    padded = np.zeros((height, width + 2), dtype=np.int8)
    padded[:, 1:-1] = cells
    # no run goes on from one row to the next: all rows are looked at as one
    change = np.diff(padded.ravel())
    rows, begins = np.divmod(np.flatnonzero(change == 1), width + 2)
    ends = np.flatnonzero(change == -1) - (width + 2) * rows
    # in one number: runs of equal columns stand one after the other, and a rectangle goes on while
    # the rows do
    runs = (begins * (width + 1) + ends) * (height + 1) + rows
    runs.sort()
    goes_on = runs[1:] == runs[:-1] + 1
    first = np.flatnonzero(np.concatenate([[True], ~goes_on])[: len(runs)])
    last = np.append(first[1:], len(runs)) - 1 if len(first) else first
    columns, bottom = np.divmod(runs[first], height + 1)
    left, right = np.divmod(columns, width + 1)
    found = np.stack([left, bottom, right, runs[last] % (height + 1) + 1], axis=1)
    return found.astype(np.intc)


def pairs(costs):
    can = np.isfinite(costs)
    if not can.any():
        return np.empty(0, dtype=np.intp), np.empty(0, dtype=np.intp)
    # a pair that cannot be costs more than all the rest together
    never = (float(np.ptp(costs[can])) + 1.0) * (min(costs.shape) + 1)
    rows, columns = linear_sum_assignment(np.where(can, costs - costs[can].min(), never))
    kept = can[rows, columns]
    return rows[kept], columns[kept]
