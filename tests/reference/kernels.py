"""Naive references of the kernels in C, by NumPy: what `kmpc_lite.control.kernels` describes."""

import math

import numpy as np

from kmpc_lite.control.kernels.records import TINY, distances, leg_end, poses_at
from kmpc_lite.control.world.occupancy import away
from kmpc_lite.model.tube import MEMORY, Carried, closed_loop, rotations

TURN_LENGTH, LOCATE_BACK, LOCATE_AHEAD, GOAL_STRETCH = 0.3, 0.5, 1.5, 0.5
LEAST_DISTANCE, AT_CENTRE = 1e-9, 1e-9
LEAVES = 0.5
SHARES = np.array((28, 24, 20, 16, 12, 8, 6, 4, 3, -32, 2, 1, -8, 0)) / 32.0
"""A motion leaves a thing if its clearance grows by this share of what is driven."""


def box_distances(low, high, points):
    return away(low, high, points)[0].min(axis=1)


def nearest_boxes(low, high, points, behind, columns):
    distance, x, y = away(low, high, points)
    count, rows = distance.shape[1], np.arange(len(points))
    if columns == count:
        chosen = np.broadcast_to(np.arange(columns), distance.shape)
    else:
        chosen = np.empty((len(points), columns), dtype=np.intp)
        left = distance.copy()
        for i in range(columns):
            nearest = left.argmin(axis=1)
            chosen[:, i] = nearest
            if i + 1 < columns:
                # what lies behind the nearest one's half-plane, itself included, is done with
                nearest += count * rows
                near = distance.take(nearest)
                along = x * (x.take(nearest) / near)[:, None]
                along += y * (y.take(nearest) / near)[:, None]
                np.putmask(left, along >= (near - behind)[:, None], np.inf)
        place = chosen + (count * rows)[:, None]
        distance, x, y = distance.take(place), x.take(place), y.take(place)
    return chosen, distance, np.stack([x / distance, y / distance], axis=-1)


def distances_of_motions(things, points, times):
    motions, _, places, _ = points.shape
    shape = motions, len(times), places
    flat = np.broadcast_to(points, (*shape, 2)).reshape(-1, 2)
    moments = np.broadcast_to(times[:, None], shape).reshape(-1)
    return distances(things, flat, moments).reshape(*shape, -1)


def distances_and_directions(things, points, times):
    away = points[:, None, :] - things[:, :2] - times[:, None, None] * things[:, 3:5]
    length = np.hypot(away[..., 0], away[..., 1])
    away[length < AT_CENTRE] = (AT_CENTRE, 0.0)
    away /= np.maximum(length, AT_CENTRE)[..., None]
    return distances(things, points, times), away


def clearances(keep, states, things, points, gaps, away):
    stages = len(states) - 1
    times = (keep.dt * np.arange(1, stages + 1)).repeat(len(points) // stages)
    distances, directions = distances_and_directions(things, points, times)
    values = [found.reshape(stages, -1) - keep.distance for found in (distances, gaps)]
    normals = [_slopes(keep, directions, points, states)]
    normals.append(away.reshape(stages, values[1].shape[1], keep.directions))
    for distance, normal in _sides(keep, states):
        values.append(distance)
        normals.append(np.zeros((*distance.shape, keep.directions)))
        normals[-1][..., :2] = normal
    return np.concatenate(values, axis=1), np.concatenate(normals, axis=1)


def _slopes(keep, away, points, states):
    stages = len(states) - 1
    if keep.directions > 2:
        arms = points.reshape(stages, -1, 2) - states[1:, None, :2]
        across = np.stack([-arms[..., 1], arms[..., 0]], axis=-1).reshape(-1, 1, 2)
        slopes = (away * across).sum(axis=-1, keepdims=True)
        away = np.concatenate([away, slopes], axis=-1)
    return away.reshape(stages, len(points) // stages * away.shape[1], keep.directions)


def _sides(keep, states):
    offsets = np.minimum(keep.side_offsets, keep.side_normals @ states[0, :2])
    sides = [(states[1:, :2] @ keep.side_normals.T - offsets, keep.side_normals)]
    if keep.range < math.inf:
        back = states[0, :2] - states[1:, :2]
        distance = np.hypot(back[:, 0], back[:, 1])[:, None]
        normals = (back / np.maximum(distance, LEAST_DISTANCE))[:, None]
        sides.append((keep.range - distance, normals))
    return sides


def nearest_half_planes(states, clearances, normals, slots):
    stages, kinds = clearances.shape
    if kinds > slots:
        nearest = np.argsort(clearances, axis=1, kind="stable")[:, :slots]
        nearest.sort(axis=1)
        clearances = np.take_along_axis(clearances, nearest, axis=1)
        normals = np.take_along_axis(normals, nearest[..., None], axis=1)
    directions = normals.shape[2]
    offsets = np.matmul(normals, states[1:, :directions, None])[..., 0] - clearances
    if kinds >= slots:
        return normals, offsets
    all_normals, all_offsets = (
        np.zeros((stages, slots, directions)),
        np.full((stages, slots), -np.inf),
    )
    all_normals[:, :kinds], all_offsets[:, :kinds] = normals, offsets
    return all_normals, all_offsets


def fill(keep, margins, numbers, lin, plan, around):
    states = plan.states
    found, normals = clearances(keep, states, *around)
    if margins is not None:
        count = found.shape[1] - len(keep.side_offsets) - (keep.range < np.inf)
        found -= _margins(margins, count, lin, plan, found, normals)
    origin = states[0] * (1.0, 1.0, 0.0)
    local = states - origin
    violation = np.maximum(-found.min(axis=1, initial=0.0), 0.0)
    np.concatenate([local[1:].ravel(), plan.inputs.ravel(), violation], out=numbers.start)
    chosen, offsets = nearest_half_planes(local, found, normals, keep.slots)
    _write(numbers, lin._replace(value=lin.value - origin), local, plan.inputs, chosen, offsets)
    np.matmul(plan.reference[1:-1] - origin, numbers.weight, out=numbers.pull[:-1])
    np.matmul(plan.reference[-1] - origin, numbers.weight_terminal, out=numbers.pull[-1])
    off = plan.reference[1:] - states[1:]
    gains = -np.vstack([off[:-1] @ numbers.weight, off[-1:] @ numbers.weight_terminal])[:, :2]
    later = np.cumsum(gains[::-1], axis=0)[::-1][1:]
    bends = (later * np.diff(states, axis=0)[1:, :2]).sum(axis=1).clip(min=0.0) * plan.to_goal
    numbers.turn[:] = numbers.turn_weight + bends
    numbers.pull[:-1, 2] -= bends * states[1:-1, 2]


def _margins(margins, count, lin, plan, clearances, normals):
    found = np.full(clearances.shape, margins.side_margin)
    if not count:
        return found
    nearest = np.minimum.reduce(clearances[:, :count], axis=None)
    if nearest < margins.widest + margins.far_clearance:
        found[:, :count] = tube_margins(
            margins.noise,
            lin.A,
            plan.states,
            plan.speeds,
            normals[:, :count],
            margins.path_clearance,
        )
    else:
        found[:, :count] = margins.widest
    return found


def covariances(noise, by_x, states, inputs):
    """Of the pose at stages 1 to N, as calibration carries errors on, (N, 3, 3)."""
    cos, sin, squares = np.cos(states[:-1, 2]), np.sin(states[:-1, 2]), inputs**2
    turned, steps = rotations(cos, sin), (by_x, closed_loop(by_x, cos, sin))
    white = (squares @ noise.white).reshape(-1, 3, 3)
    out = noise.pose.reshape(3, 3) + squares[:, :1, None] * noise.pose_by_speed.reshape(3, 3)
    out, white = (turned @ part @ turned.swapaxes(1, 2) for part in (out, white))
    lasting = np.concatenate([np.diag(row) for row in noise.lasting], axis=1)
    added = {True: white, False: turned @ (lasting * inputs.repeat(3, axis=1)[:, None])}
    for k in range(len(by_x)):
        felt = slice(max(k + 1 - MEMORY - noise.delay, 0), k + 1)
        for squared, parts in added.items():
            carried = Carried(
                *(s[None, felt] for s in steps), noise.delay, parts[None, felt], squared
            )
            for i in range(len(parts[felt])):
                spread = carried.after(i)[0]
            out[k] += spread if squared else spread @ spread.T
    return out


def tube_margins(noise, by_x, states, inputs, normals, path_clearance):
    steps = np.abs(np.diff(states, axis=0))
    lengths = np.hypot(steps[:, 0], steps[:, 1]) + noise.reach * steps[:, 2]
    bulges, squares = lengths * steps[:, 2] / 8, lengths * lengths / 4
    for part in (bulges, squares):
        part[:-1] = np.maximum(part[:-1], part[1:])
    chords = np.sqrt((noise.touch + bulges) ** 2 + squares) - noise.touch + noise.solver_margin
    kept = np.minimum(noise.headway_time * np.abs(inputs[:, 0]), path_clearance)[:, None]
    if noise.spreads:
        count = normals.shape[2]
        spread = covariances(noise, by_x, states, inputs)[:, :count, :count]
        variances = np.einsum("nsi,nij,nsj->ns", normals, spread, normals)
        kept = np.maximum(noise.quantile * np.sqrt(variances), kept)
    return np.broadcast_to(kept, normals.shape[:2]) + chords[:, None]


def _write(numbers, lin, x, u, normals, offsets):
    value, by_x, by_u, by_past = lin
    stages, history = len(u), by_past.shape[1]
    right = value - (by_u @ u[..., None])[..., 0]
    right[1:] -= (by_x[1:] @ x[1:-1, :, None])[..., 0]
    blocks = [by_x[1:].ravel(), by_u.ravel()]
    for j in range(1, min(history, stages - 1) + 1):
        by_age = by_past[j:, j - 1]
        blocks.append(by_age.ravel())
        right[j:] -= (by_age @ u[: stages - j, :, None])[..., 0]
    written = np.concatenate([*blocks, -numbers.scale * normals.ravel()])
    numbers.entries[numbers.places] = np.negative(written, out=written)
    numbers.dynamics_lower[:] = right
    numbers.dynamics_upper[:] = right
    np.maximum(numbers.scale * offsets, -numbers.open_bound, out=numbers.half_plane_lower)


def added_up(rates, whole, lasting, rare, usual):
    single, summed = np.zeros(rates.shape[1:]), np.zeros(rates.shape[1:])
    for rate, each, lasts in zip(rates, whole.tolist(), lasting.tolist(), strict=True):
        squares, white = rate * rate, max(each - lasts, 0.0)
        single += rare**2 * each * squares
        summed += rare**2 * white * np.cumsum(squares, axis=-1)
        if lasts:
            summed += usual**2 * lasts * np.cumsum(rate, axis=-1) ** 2
    worst = np.maximum.accumulate(single, axis=-1)
    return np.sqrt(np.maximum(worst, summed))


def led_aside(rates, dt, whole, lasting, rare, usual):
    driven = rates[0] * dt
    ends = np.cumsum(driven, axis=-1)
    begins, squared = ends - driven, np.zeros_like(ends)
    for rate, each, lasts in zip(rates, whole.tolist(), lasting.tolist(), strict=True):
        white = rare**2 * max(each - lasts, 0.0) * rate * rate
        if white.any():
            # the sum of what comes from each period, by the squared way from its begin on
            constant, linear, square = (np.cumsum(white * begins**n, axis=-1) for n in range(3))
            squared += ends * (ends * constant - 2.0 * linear) + square
        if lasts:
            way = ends * np.cumsum(rate, axis=-1) - np.cumsum(rate * begins, axis=-1)
            squared += usual**2 * lasts * way * way
    return np.sqrt(np.maximum(squared, 0.0))


def stop_errors(distances, turns, dt, position, heading, rare, usual, reach):
    rates = np.abs(np.stack([distances, turns])) / dt
    own = added_up(rates, position[:2], position[2:], rare, usual)
    errors = np.hypot(own, led_aside(rates, dt, heading[:2], heading[2:], rare, usual))
    if reach:
        errors += reach * added_up(rates, heading[:2], heading[2:], rare, usual)
    return errors


def candidates(brakes, inputs, hardest, whole, at_once):
    step, faster, slower, curvature, longest, further = brakes
    further = 0 if whole or at_once else further

    def sizes(commands):
        return (np.abs(commands) / step).max(axis=-1)

    def periods(commands):
        return int(np.clip(np.ceil(sizes(commands) - TINY).max(), 1, longest))

    def within(commands):
        most = curvature * np.abs(commands[..., :1]) if curvature < np.inf else np.inf
        return np.concatenate([commands[..., :-1], np.clip(commands[..., -1:], -most, most)], -1)

    def straight(first, length):
        shares = np.maximum(1.0 - np.arange(1, length + 1) / max(sizes(first), TINY), 0.0)
        return np.append(shares[:-1], 0.0)[:, None] * first

    def along(first, length):
        size, own = sizes(inputs), sizes(first)
        left = np.append(np.maximum(own - np.arange(1, length), 0.0), 0.0)
        if not (drives := size > TINY).any():
            return straight(first, length)
        middles, places = (np.cumsum(size) - 0.5 * size)[drives], own + np.cumsum(left) - 0.5 * left
        directions = (inputs[drives] / size[drives, None]).T
        wanted = left[:, None] * np.stack([np.interp(places, middles, d) for d in directions], -1)
        ramp = [first]
        for command in wanted:
            change, before = command - ramp[-1], ramp[-1]
            most = np.where(change * before < 0.0, slower, faster)
            ramp.append(within(before + np.clip(change, -most, most)))
        change, before = np.diff(ramp, axis=0), ramp[:-1]
        most = np.where(change * before < 0.0, slower, faster) * (1.0 + TINY) + TINY
        ends = (np.abs(change) <= most).all() and np.abs(ramp[-1]).max() <= TINY
        return np.array(ramp[1:]) if ends else straight(first, length)

    m, firsts = inputs.shape[1], inputs[:1]
    if not whole:
        shares = np.outer(np.maximum(SHARES, 0.0), np.ones(m))
        shares[:, -1] = np.abs(SHARES)
        firsts = within(hardest + shares * (inputs[0] - hardest))
    length = periods(firsts)
    found = [
        np.concatenate([inputs[: j + 1], straight(inputs[j], periods(inputs[j]))])
        for j in range(1, further + 1)
    ]
    turns = [False] * further
    for i, first in enumerate(firsts):
        brakes = [straight(first, length)] if whole or not at_once else []
        brakes.append(np.zeros((1, m)) if at_once else along(first, length))
        found += [np.concatenate([first[None], brake]) for brake in brakes]
        turns += [not whole and i == len(firsts) - 2] * len(brakes)
    out = np.zeros((len(found), max(map(len, found)), m))
    for row, motion in zip(out, found, strict=True):
        row[: len(motion)] = motion
    ends = ((out != 0.0).any(axis=2) * np.arange(1, out.shape[1] + 1)).max(axis=1)
    return out, np.arange(len(out)) < further, np.array(turns), ends


def samples(states, count):
    share = (np.arange(count) + 1.0) / count
    step = np.diff(states, axis=1)[:, :, None]
    poses = states[:, :-1, None] + share[:, None] * step
    bulge = 2.0 * (share * (1.0 - share)) * np.tan(0.25 * step[..., 2])
    poses[..., 0] += bulge * step[..., 1]
    poses[..., 1] -= bulge * step[..., 0]
    return poses.reshape(len(states), -1, 3)


def between_samples(clearance, standing, places, begin, radius):
    steps = np.diff(places, axis=1, prepend=np.broadcast_to(begin, (len(places), 1, *begin.shape)))
    squares = (steps * steps).sum(axis=-1)[..., None]
    lost = squares / (8.0 * radius)
    first = np.broadcast_to(standing[:, :1], (len(places), 1, *clearance.shape[2:]))
    before = np.concatenate([first, clearance[:, :-1]], axis=1)
    begins = np.where(clearance - before < lost, before - lost, np.inf)
    return np.minimum(clearance - lost, begins)


def surely_clear(clearance, margins, error, travel, ends, lost):
    most = np.maximum(margins, (error + LEAVES * travel)[:, None]) + lost
    enough = clearance.min(axis=(2, 3)) >= most
    after = np.arange(clearance.shape[1]) >= ends[:, None]
    return np.logical_and.reduce(enough | after, axis=1)


def admissible(
    clearance, standing, spend, margins, driven, error, turns, strict, ends, first, unsure
):
    left = standing - spend
    needed = np.minimum(margins[:, :, None, None], left)
    gain = clearance[:, :first] - standing[:, :first]
    half = LEAVES * driven[:, :first, :, None]
    own = error[:, None]
    kept = np.minimum(left[:, :first], unsure) + np.where(turns, np.maximum(half, own), own)
    leaves = (gain > 0.0) & (gain >= half)
    needed[:, :first] = np.where(leaves, left[:, :first], np.maximum(needed[:, :first], kept))
    needed = np.where(strict[:, None, None, None], margins[:, :, None, None], needed)
    # also false for NaN
    enough = np.logical_and.reduce(clearance >= needed - TINY, axis=(2, 3))
    after = np.arange(clearance.shape[1]) >= ends[:, None]
    return np.logical_and.reduce(enough | after, axis=1)


def locate(path, pose, place, least):
    last, duration, step = max(place, least), float(path.times[-1]), path.step
    begin = int(max(place - LOCATE_BACK, least) / step)
    begin += len(path.cusps) > 0  # the pose before a change of gear is not on this leg
    end = int(min(last + LOCATE_AHEAD, leg_end(path, least)) / step) + 2
    times = np.minimum(step * np.arange(begin, max(end, begin + 1)), duration)
    # next to the heading at the last place: the robot has not turned by half a circle since
    before = poses_at(path, np.array([min(int(last / step) * step, duration)]))[0, 2]
    heading = pose[2] - math.tau * np.rint((pose[2] - before) / math.tau)
    error = poses_at(path, times) - (pose[0], pose[1], heading)
    error[:, 2] *= TURN_LENGTH
    nearest = int(np.einsum("ni,ni->n", error, error).argmin())
    return float(times[nearest]), math.hypot(error[nearest, 0], error[nearest, 1])


def times_after(path, place, leg, later):
    end, braking = min(leg_end(path, leg), float(path.times[-2])), path.braking
    left = end - place
    if left <= 0.0 or braking == 0.0:
        return place + later
    # with a constant deceleration the root of the time that is left shrinks evenly
    root, rate = math.sqrt(min(left, 0.5 * braking)), 1.0 / math.sqrt(2.0 * braking)
    slowed = later - max(left - 0.5 * braking, 0.0)
    braked = end - np.maximum(root - rate * slowed, 0.0) ** 2
    times = np.where(slowed <= 0.0, place + later, braked)
    return times + np.maximum(slowed - root / rate, 0.0)


def along_path(path, later, place, leg, heading, turning):
    drive_end = path.times[-2]
    times = place + later if turning else times_after(path, place, leg, later)
    if not turning and place > drive_end - GOAL_STRETCH:
        times = np.minimum(times, drive_end)
    states = poses_at(path, np.minimum(times, leg_end(path, leg)))
    here = poses_at(path, np.array([place]))[0, 2]
    states[:, 2] += math.tau * np.rint((heading - here) / math.tau)
    return states
