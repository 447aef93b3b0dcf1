"""The kernels in C, called with arrays that they check: of plans, paths, stops, scans and tracks.

Sizes: a map of H by W cells, at most 400 by 400.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import _kernels as c  # type: ignore[attr-defined]
from kmpc_lite.control.kernels.records import (
    NOISE_ARRAYS,
    SLOWER,
    Around,
    Bits,
    Brakes,
    Iterate,
    KeepOut,
    Motions,
    Noise,
    Numbers,
    PlanMargins,
    Timed,
)
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.types import STATES, Array

Cells = NDArray[np.int8]
Singles = NDArray[np.float32]
dense: Callable[[Array], Array] = partial(np.ascontiguousarray, dtype=np.float64)
"""Array as the kernels take it: float64, row by row."""


def clusters(
    reach: Array,
    ends: Array,
    hits: Bits,
    clear: Bits,
    mount: Array,
    step: float,
    gap: float,
    largest: float,
) -> Array:
    """Circles (K, 3) of what stands free: nothing nearer hides its left or its right side.

    Beams that tell nothing are left out. What is seen of a wall past a nearer thing moves with the
    robot, and is no cluster.

    `reach`: (B,) how far each beam saw nothing [m]. `ends`: (B, 2) where it ends in the robot's
    frame [m]. `hits`, `clear`: (B,) whether it hit something, and whether it saw that nothing is
    there. `mount`: (2,) the scanner in the robot's frame [m]. `step`: angle from beam to beam
    [rad]. `gap`: distance between neighbouring hits beyond which another cluster begins [m].
    `largest`: largest radius of a cluster [m]. Returns (K, 3) rows x, y, radius [m] in the robot's
    frame.
    """
    beams = len(reach)
    out, count = np.empty((beams // 3 + 1, 3)), np.empty(1, dtype=np.intc)
    own = dense(reach), dense(ends), hits, clear, dense(mount)
    c.clusters(*own, np.empty(beams, dtype=np.intc), out, count, step, gap, largest)
    return out[: count[0]]


def follow(
    tracks: Array, circles: Array, sources: Array, *numbers: float
) -> tuple[Array, NDArray[np.intc]]:
    """Bring tracks to the next period, with the circles that are seen then.

    Circles that are farther than the gate from where a track expects them may be its all the same
    if it turned round: then its velocity may be any of the same pace.

    `tracks`: (M, 39). `circles`, `sources`: (N, 5) and (N,) which sensor sees each: a track is that
    of one sensor. `dt`: period [s]. `memory`: how long turns last [s]. `acceleration`: standard
    deviation of accelerations along each axis [m/s^2]. `turning`: the same of turn rates [rad/s].
    `noise`: the same of a position along each axis [m]. `other`: the same of the change of velocity
    of what turned round [m/s]. `gate`, `chance`: squared Mahalanobis distances: of positions that
    are not a track's any more, and of velocities that differ from the given ones. Returns `after`:
    (M, 39); `found`: (N,) index of each circle's track; -1 for none.
    """
    rows, columns = len(tracks), len(circles)
    after, found = np.array(tracks, dtype=np.float64), np.empty(columns, dtype=np.intc)
    room = np.empty(rows * columns + 3 * rows + 2 * columns)
    indices = np.empty(4 * rows + 3 * columns, dtype=np.intc)
    c.follow(dense(circles), dense(sources), after, found, room, indices, *numbers)
    return after, found


def told_beams(
    ranges: Array, along: Array, counts: Bits, mount: Array, least: float, most: float, own: float
) -> tuple[Bits, Bits, Array, Array]:
    """Tell what each beam of a scan says.

    `ranges`: (B,) [m]. `along`: (B, 2) unit vectors of the beams in the robot's frame. `counts`:
    (B,) which beams count. `mount`: (2,) the scanner in the robot's frame [m]. `least`, `most`:
    ranges that are hits lie between these [m]; the latter itself and infinity say that nothing is
    there. `own`: hits no farther from the robot's centre are the robot itself [m]. Returns `hits`,
    `clear`: (B,) which beams hit something, and which saw that nothing is there; `reach`: (B,) how
    far each saw nothing; zero if it tells nothing [m]; `ends`: (B, 2) where it ends in the robot's
    frame [m].
    """
    beams = len(ranges)
    kinds = np.empty(beams, dtype=bool), np.empty(beams, dtype=bool)
    lengths = np.empty(beams), np.empty((beams, 2))
    given = dense(ranges), dense(along), np.ascontiguousarray(counts), dense(mount)
    c.told_beams(*given, *kinds, *lengths, least, most, own)
    return *kinds, *lengths


def averaged_ranges(
    ranges: Array, hits: Bits, step: float, noise: float, half: float
) -> tuple[Array, Array]:
    """Average each range with its neighbours on the same surface.

    A surface is known better than one beam tells: the outermost of many noisy hits would lie
    farther out than the surface, the more so the more beams meet it.

    `ranges`: (B,) [m]. `hits`: (B,) which beams hit something. `step`: angle from beam to beam
    [rad]. `noise`: standard deviation of a range [m]. `half`: how far along a surface neighbours
    lie at the most [m]. Returns `averaged`: (B,) ranges, those of other beams as they were [m];
    `deviations`: (B,) standard deviations of these, as far as they are sure [m].
    """
    found = np.empty(len(ranges)), np.empty(len(ranges))
    c.averaged_ranges(dense(ranges), np.ascontiguousarray(hits), *found, step, noise, half)
    return found


def pass_rays(
    state: Cells,
    seen: Singles,
    extent: Singles,
    place: tuple[float, int, int],
    low: tuple[float, float],
    high: tuple[float, float],
    origin: tuple[float, float],
    turn: tuple[float, float],
    squares: Singles,
    distance: float,
    farther: bool,
    clock: float,
) -> None:
    """Take note of what rays passed through (`see_through`); farther away only of what was hit.

    `state`, `seen`, `extent`, `place`, `origin`, `turn`, `squares`, `clock`: as of `see_through`.
    `low`, `high`: corners of the area that no ray has left [m]. `distance`: from the origin, along
    each axis, up to which all cells are looked at [m]. `farther`: whether those farther away are
    looked at.
    """
    where = state.shape[1], *place, *low, *high, *origin, *turn
    c.pass_rays(state, seen, extent, squares, *where, distance, farther, clock)


def mark(
    state: Cells,
    seen: Singles,
    extent: Singles,
    taken: Singles,
    points: Array,
    errors: Array,
    place: tuple[float, int, int],
    level: int,
    clock: float,
) -> None:
    """Mark the cells of hits (n, 2), which may be off by errors (n,), as occupied.

    `state`, `seen`, `extent`, `place`: as of `see_through`; changed. `taken`: (H, W) when each was
    hit that was free until then; changed. `points`, `errors`: (n, 2) and (n,) [m]. `level`: state
    of cells that are occupied. `clock`: now.
    """
    cells, width = (state, seen, extent, taken), state.shape[1]
    c.mark(*cells, dense(points), dense(errors), width, *place, level, clock)


def hit_boxes(
    state: Cells, extent: Singles, window: tuple[int, int, int, int], place: tuple[float, int, int]
) -> tuple[Array, Array]:
    """Corners (n, 2), (n, 2) of what was hit in the occupied cells of a window, row by row.

    `state`, `extent`, `window`, `place`: as of `see_through`.
    """
    top, bottom, left, right = window
    most = max(bottom - top, 0) * max(right - left, 0)
    low, high, count = np.empty((most, 2)), np.empty((most, 2)), np.empty(1, dtype=np.intc)
    c.hit_boxes(state, extent, low, high, count, state.shape[1], *place, *window)
    return low[: count[0]].copy(), high[: count[0]].copy()


def rectangles(cells: Bits) -> NDArray[np.intc]:
    """Rectangles (B, 4) of cells (H, W): first column and row, and one past the last of each.

    Each is a run of cells in a row, joined with equal runs of the rows that follow; they come in
    the order of their first columns, then of their last ones, then of their rows.
    """
    height, width = cells.shape
    most, count = width // 2 + 1, np.empty(1, dtype=np.intc)
    found = np.empty((height * most, 4), dtype=np.intc)
    room = np.empty(2 * most, dtype=np.intc)
    c.rectangles(np.ascontiguousarray(cells), room, found, count, width)
    return found[: count[0]].copy()


NOTHING = np.empty(0)
NO_NOISE = Noise(NOTHING, NOTHING, NOTHING, NOTHING, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


def distances_of_motions(things: Array, points: Array, times: Array) -> Array:
    """Distances (C, Q, E, M) of points on C motions from the edges of all things [m].

    `things`: (M, 7). `points`, `times`: (C, Q, E, 2), or (C, 1, E, 2) of points that stay [m], and
    (Q,) [s], from now.
    """
    motions, sampled, places, _ = points.shape
    out = np.empty((motions, len(times), places, len(things)))
    c.distances(dense(things), dense(points), dense(times), out, motions, sampled, places)
    return out


def box_distances(low: Array, high: Array, points: Array) -> Array:
    """Distances (n,) of points (n, 2) from the nearest of rectangles [m], negative inside.

    `low`, `high`: corners (B, 2) each [m]. `points`: (n, 2) [m].
    """
    out = np.empty(len(points))
    c.box_distances(*map(dense, (low, high, points)), out)
    return out


def nearest_boxes(
    low: Array, high: Array, points: Array, behind: float, columns: int
) -> tuple[Array, Array, Array]:
    """The rectangles that matter at points: the nearest, then the nearest that is not behind it.

    `low`, `high`, `points`: as of `box_distances`. `behind`: how far a rectangle's nearest point
    may stand out of another one's half-plane and count as behind it [m]. `columns`: how many are
    chosen, K, at most B. Returns `chosen`, `distances`, `normals`: their numbers (n, K), distances
    (n, K) [m], negative inside, and normals (n, K, 2).
    """
    shape, room = (len(points), columns), np.empty((len(low), 4))
    found = np.empty(shape, dtype=np.int_), np.empty(shape), np.empty((*shape, 2))
    c.nearest_boxes(*map(dense, (low, high, points)), room, *found, behind, columns)
    return found


def fill(
    keep: KeepOut,
    margins: PlanMargins | None,
    numbers: Numbers,
    lin: Linearization,
    plan: Iterate,
    around: Around,
) -> None:
    """Write a pass into a QP.

    `keep`, `margins`, `numbers`: what follows from the problem; none without margins; what is
    written. `lin`: the model's at the plan. `plan`, `around`: the plan, and what it is kept out of.
    """
    stages, places = len(plan.inputs), len(around.points) // len(plan.inputs)
    kinds = around.gaps.size // stages + places * len(around.things) + len(keep.side_offsets) + 1
    per_stage = kinds * (2 + keep.directions) + keep.slots * (1 + keep.directions)
    noise = NO_NOISE if margins is None else margins.noise
    widest, far, side, path = (0.0, 0.0, 0.0, NOTHING) if margins is None else margins[1:]
    *arrays, turn, turn_weight, scale, open_bound = numbers
    c.fill(
        *map(dense, (*lin, *plan[:3], *around)),
        keep.side_normals,
        keep.side_offsets,
        *arrays,
        np.empty(stages * per_stage + 3 * (stages + 1)),
        dense(plan.speeds),
        path,
        *noise[:NOISE_ARRAYS],
        turn,
        stages,
        lin.B_past.shape[1],
        keep.slots,
        keep.directions,
        places,
        scale,
        open_bound,
        keep.distance,
        keep.dt,
        keep.range,
        margins is not None,
        *noise[NOISE_ARRAYS:],
        widest,
        far,
        side,
        turn_weight,
        plan.to_goal,
    )


def tube_margins(
    noise: Noise, by_x: Array, states: Array, inputs: Array, normals: Array, path_clearance: Array
) -> Array:
    """Margins (N, K) of stages 1 to N [m].

    `noise`: what is not known. `by_x`, `states`, `inputs`: the model's derivatives by the state (N,
    3, 3) at the plan: (N + 1, 3) and (N, 2), speeds and turn rates. `normals`: (N, K, 2) unit
    vectors away from obstacles; (N, K, 3) with the slope by the heading. `path_clearance`: (N,)
    what the path keeps [m]: headway is no more.
    """
    out, directions = np.empty(normals.shape[:2]), normals.shape[2]
    given = map(dense, (by_x, states, inputs, normals, path_clearance))
    c.tube_margins(*given, *noise[:NOISE_ARRAYS], out, directions, *noise[NOISE_ARRAYS:])
    return out


def stop_errors(
    distances: Array, turns: Array, dt: float, position: Array, heading: Array, *numbers: float
) -> Array:
    """Errors (..., T) at the end of each period of what is driven and turned [m].

    `distances`, `turns`: what is driven [m] and turned [rad] in each period, (..., T). `dt`: period
    [s]. `position`, `heading`: (4,) variances of one period by v^2 and by omega^2, then what lasts
    of them. `rare`, `usual`: as of `added_up`. `reach`: how far the outline lies from the pose [m].
    """
    out = np.empty(distances.shape)
    arrays = map(dense, (distances, turns, position, heading))
    c.stop_errors(*arrays, out, distances.shape[-1], dt, *numbers)
    return out


def candidates(
    brakes: Brakes, inputs: Array, hardest: Array, whole: bool, at_once: bool
) -> Motions:
    """Motions that begin with a plan's coming command, or with further and slower ones of it.

    `brakes`: of the robot. `inputs`: the plan (N, m). `hardest`: (m,) the coming command that
    brakes hardest. `whole`: whether with the plan's coming command. `at_once`: whether the robot
    can stand in the coming period.
    """
    *arrays, curvature, longest, further = brakes
    count, periods, m = further + 2 * SLOWER, further + 2 + longest, inputs.shape[1]
    flat = np.empty((2 if whole else count) * periods * m)
    kinds, sizes = np.empty((count, 3), dtype=np.intc), np.empty(2, dtype=np.intc)
    own = *arrays, dense(inputs), dense(hardest), flat, kinds, sizes
    c.candidates(*own, curvature, longest, further, whole, at_once)
    count, periods = sizes.tolist()
    commands, (strict, turns, ends) = flat[: count * periods * m], kinds[:count].T
    return Motions(commands.reshape(count, periods, m), strict != 0, turns != 0, ends)


def samples(states: Array, count: int) -> Array:
    """Poses (C, T count, 3) on the arcs between states (C, T + 1, 3), the first left out."""
    motions, poses, _ = states.shape
    out = np.empty((motions, (poses - 1) * count, STATES))
    c.samples(dense(states), out, motions, count)
    return out


def between_samples(
    clearance: Array, standing: Array, places: Array, begin: Array, radius: float
) -> Array:
    """Clearance (C, Q, E, K) at samples less what the chords between them may cut off [m].

    Past a point that the robot touches at a radius [m]. `standing` (1, Q, E, K) is the clearance at
    `begin` (E, 2), where the robot is now, `places` (C, Q, E, 2) are the samples. A chord that
    leads away begins at its nearest.
    """
    out = np.empty(clearance.shape)
    arrays = map(dense, (clearance, standing, places, begin))
    c.between_samples(*arrays, out, len(places), radius)
    return out


def surely_clear(
    clearance: Array, margins: Array, error: Array, travel: Array, ends: Array, lost: float
) -> Array:
    """Which motions keep more than `admissible` can ask of them, (C,).

    `clearance`: (C, Q, E, K) at samples of the motions [m]. `margins`: (C, Q) of what is driven and
    turned up to each sample [m]. `error`, `travel`: (C,) the largest error of the coming commands,
    with what is not sure, and how far they lead [m]. `ends`: (C,) samples until the robot is at
    rest. `lost`: what chords between samples cut off at the most [m].
    """
    out = np.empty(len(error), dtype=np.bool_)
    arrays = map(dense, (clearance, margins, error, travel))
    c.surely_clear(*arrays, np.ascontiguousarray(ends, dtype=np.intc), out, lost)
    return out


def admissible(
    clearance: Array,
    standing: Array,
    spend: Array,
    margins: Array,
    driven: Array,
    error: Array,
    turns: Array,
    strict: Array,
    ends: Array,
    first: int,
    unsure: float,
) -> Array:
    """Which motions stay clear until they end, (C,).

    At every sample a robot keeps the margin of what it has driven and turned, or the clearance that
    it would have standing, less what it may spend. In the coming period, which no later step can
    mend, it also keeps the command's own error, beside what is not sure and what a standing robot
    would lack, unless the motion leads away; a thing that may turn towards the robot counts as an
    error of half of what is driven.

    `clearance`: (C, Q, E, K) at samples of the motions [m]. `standing`, `spend`: (1, Q, E, K)
    clearance of a robot that stands, and how much of it may be used up [m]. `margins`: (C, Q) of
    what is driven and turned up to each sample [m]. `driven`: (C, Q, E) from the begin on [m].
    `error`: (C, E, K) of the coming commands, towards each thing [m]. `turns`: (K,) whether a thing
    may turn towards the robot. `strict`: (C,) whether a motion must keep its margins whatever a
    standing robot has. `ends`: (C,) samples until the robot is at rest. `first`: samples of the
    coming period. `unsure`: what the pose's noise may pretend of a clearance [m].
    """
    out = np.empty(len(clearance), dtype=np.bool_)
    arrays = map(dense, (clearance, standing, spend, margins, driven, error))
    which = np.ascontiguousarray(turns), np.ascontiguousarray(strict)
    c.admissible(*arrays, *which, np.ascontiguousarray(ends, dtype=np.intc), out, first, unsure)
    return out


def locate(path: Timed, pose: Array, place: float, least: float) -> tuple[float, float]:
    """Find the robot's place: the time of the path's pose that is nearest.

    `path`: what is followed. `pose`: the robot's pose (3,). `place`: where it was found last [s];
    only places near it are looked at. `least`: where it must have come to [s]. Returns `place`,
    `off`: the time on the path [s], and the distance from its pose there [m].
    """
    found = np.empty(2)
    c.locate(*path[:3], dense(pose), found, path.step, place, least)
    return found.item(0), found.item(1)


def along_path(
    path: Timed, later: Array, place: float, leg: float, heading: float, turning: bool
) -> Array:
    """Poses (n, 3) of a robot that drives on along its path, their headings near its own.

    `path`: what is followed. `later`: how much later, (n,) [s]. `place`: where the robot is [s].
    `leg`: when its gear has changed last [s]. `heading`: its own [rad]. `turning`: whether it is on
    its last turn.
    """
    states = np.empty((len(later), STATES))
    c.along_path(*path[:3], dense(later), states, path.braking, place, leg, heading, turning)
    return states


def ways(free: Bits, factor: Array, step: float, goal: int) -> tuple[Array, NDArray[np.intc]]:
    """Shortest ways on a grid (H, W) to a goal, over sixteen neighbours of each node.

    `free`: (H, W) nodes that ways may use. `factor`: (H, W) by which lengths count: of a step, that
    of its upper or left end. `step`: distance between neighbours along the axes [m]. `goal`: number
    of the goal's node. Returns `cost`, `towards`: (H W,) of the way from each node [m], infinite
    without one; the next node on it, -1 at the goal and without a way.
    """
    nodes, width, own = free.size, free.shape[1], (np.ascontiguousarray(free), dense(factor))
    cost, towards = np.empty(nodes), np.empty(nodes, dtype=np.intc)
    c.ways(*own, cost, towards, np.empty(2 * nodes, dtype=np.intc), width, step, goal)
    return cost, towards
