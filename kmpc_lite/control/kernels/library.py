"""The kernels in C for plans, paths and the margins of a stop."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels import _kernels as c  # type: ignore[attr-defined]
from kmpc_lite.control.kernels.records import (
    NOISE_ARRAYS,
    SLOWER,
    Around,
    Brakes,
    Iterate,
    KeepOut,
    Motions,
    Noise,
    Numbers,
    PlanMargins,
    Timed,
)
from kmpc_lite.control.kernels.scan_library import Bits
from kmpc_lite.control.kernels.scan_library import dense as _dense
from kmpc_lite.model.bilinear import Linearization
from kmpc_lite.types import STATES, Array

NOTHING = np.empty(0)
NO_NOISE = Noise(NOTHING, NOTHING, NOTHING, NOTHING, 0, 0.0, 0.0, 0.0, 0.0, 0.0, False)


def distances_of_motions(things: Array, points: Array, times: Array) -> Array:
    """Distances (C, Q, E, M) of points on C motions from the edges of all things [m].

    `things`: (M, 7). `points`, `times`: (C, Q, E, 2), or (C, 1, E, 2) of points that stay [m], and
    (Q,) [s], from now.
    """
    motions, sampled, places, _ = points.shape
    out = np.empty((motions, len(times), places, len(things)))
    c.distances(_dense(things), _dense(points), _dense(times), out, motions, sampled, places)
    return out


def box_distances(low: Array, high: Array, points: Array) -> Array:
    """Distances (n,) of points (n, 2) from the nearest of rectangles [m], negative inside.

    `low`, `high`: corners (B, 2) each [m]. `points`: (n, 2) [m].
    """
    out = np.empty(len(points))
    c.box_distances(*map(_dense, (low, high, points)), out)
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
    c.nearest_boxes(*map(_dense, (low, high, points)), room, *found, behind, columns)
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
        *map(_dense, (*lin, *plan[:3], *around)),
        keep.side_normals,
        keep.side_offsets,
        *arrays,
        np.empty(stages * per_stage + 3 * (stages + 1)),
        _dense(plan.speeds),
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
    given = map(_dense, (by_x, states, inputs, normals, path_clearance))
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
    dense = map(_dense, (distances, turns, position, heading))
    c.stop_errors(*dense, out, distances.shape[-1], dt, *numbers)
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
    own = *arrays, _dense(inputs), _dense(hardest), flat, kinds, sizes
    c.candidates(*own, curvature, longest, further, whole, at_once)
    count, periods = sizes.tolist()
    commands, (strict, turns, ends) = flat[: count * periods * m], kinds[:count].T
    return Motions(commands.reshape(count, periods, m), strict != 0, turns != 0, ends)


def samples(states: Array, count: int) -> Array:
    """Poses (C, T count, 3) on the arcs between states (C, T + 1, 3), the first left out."""
    motions, poses, _ = states.shape
    out = np.empty((motions, (poses - 1) * count, STATES))
    c.samples(_dense(states), out, motions, count)
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
    dense = map(_dense, (clearance, standing, places, begin))
    c.between_samples(*dense, out, len(places), radius)
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
    dense = map(_dense, (clearance, margins, error, travel))
    c.surely_clear(*dense, np.ascontiguousarray(ends, dtype=np.intc), out, lost)
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
    dense = map(_dense, (clearance, standing, spend, margins, driven, error))
    which = np.ascontiguousarray(turns), np.ascontiguousarray(strict)
    c.admissible(*dense, *which, np.ascontiguousarray(ends, dtype=np.intc), out, first, unsure)
    return out


def locate(path: Timed, pose: Array, place: float, least: float) -> tuple[float, float]:
    """Find the robot's place: the time of the path's pose that is nearest.

    `path`: what is followed. `pose`: the robot's pose (3,). `place`: where it was found last [s];
    only places near it are looked at. `least`: where it must have come to [s]. Returns `place`,
    `off`: the time on the path [s], and the distance from its pose there [m].
    """
    found = np.empty(2)
    c.locate(*path[:3], _dense(pose), found, path.step, place, least)
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
    c.along_path(*path[:3], _dense(later), states, path.braking, place, leg, heading, turning)
    return states


def ways(free: Bits, factor: Array, step: float, goal: int) -> tuple[Array, NDArray[np.intc]]:
    """Shortest ways on a grid (H, W) to a goal, over sixteen neighbours of each node.

    `free`: (H, W) nodes that ways may use. `factor`: (H, W) by which lengths count: of a step, that
    of its upper or left end. `step`: distance between neighbours along the axes [m]. `goal`: number
    of the goal's node. Returns `cost`, `towards`: (H W,) of the way from each node [m], infinite
    without one; the next node on it, -1 at the goal and without a way.
    """
    nodes, width, own = free.size, free.shape[1], (np.ascontiguousarray(free), _dense(factor))
    cost, towards = np.empty(nodes), np.empty(nodes, dtype=np.intc)
    c.ways(*own, cost, towards, np.empty(2 * nodes, dtype=np.intc), width, step, goal)
    return cost, towards
