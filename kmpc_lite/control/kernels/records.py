"""What the kernels are handed: numbers of a pass's QP, timed paths, motions that end at rest.

Half-planes keep each stage out of the nearest few obstacles and sides, margins away from them. The
QP is solved around the robot's place, so that its relative tolerance does not depend on where the
map has its origin. A motion to rest is a coming command followed by a brake: down the ramp on the
curve that the robot is on, or along the plan's path. Sizes: N stages, at most 50; m commands; L
past ones, at most 8; S slots; C motions; T periods; K things.

Everything round that may be hit is a row of one table (M, 7): x, y, radius [m], vx, vy [m/s], how
fast it spreads [m/s], and by how much at the most [m]. At time t it lies within
``radius + min(spread_rate * t, spread_max)`` of ``centre + velocity * t``. What is given to stand
has zeros; what was seen to move spreads by what is not known of its velocity.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.types import STATES, Array

Bits = NDArray[np.bool_]
NOISE_ARRAYS = 4  # how many of these are arrays, the first
TINY = 1e-9  # sizes of commands, in periods of braking, and lengths [m] that count as none
TINY_STEP = 1e-4  # step of numerical differences, as a share of the robot's radius
SLOWER = 14  # coming commands that are tried instead of a plan's
MOST_SAMPLES = 8  # most samples a period


class KeepOut(NamedTuple):
    """What follows from the problem."""

    distance: float  # radius of the outline's circles, and the problem's margin [m]
    dt: float  # period [s]
    range: float  # how far from the robot all is known [m]; infinite if it always is
    side_normals: Array  # (sides, 2) of the area's sides ``normal . p >= offset`` ...
    side_offsets: Array  # (sides,) ... and how far out they lie [m].
    directions: int
    """By how many of a state's coordinates a clearance has slopes: x, y, and the heading of a robot
    that is not round."""
    slots: int  # half-planes a stage, at most 16


class Noise(NamedTuple):
    """What the margins of a plan follow from: how far a robot spreads around it.

    Each stage feels the noise of the periods before, carried on by the model's Jacobians: without
    feedback for as long as commands take to act, then under the feedback that later steps give,
    which has forgotten what is older still (`kmpc_lite.model.tube`, by which they were calibrated).
    White noise of each period adds its covariance; what is alike in all periods is one column, to
    which each of them adds.
    """

    white: Array  # (2, 9) covariances (3, 3) of a period's noise, by v^2 and by omega^2
    lasting: Array  # (2, 3) deviations of errors that are alike in all periods, by v and by omega
    pose: Array  # (3, 3) covariance of a measured pose
    pose_by_speed: Array  # (3, 3), the same by v^2
    delay: int  # periods until the feedback acts
    quantile: float  # how many standard deviations are kept
    headway_time: float  # time of driving on at a speed that is the least margin [s]
    touch: float  # radius at which chords cut [m]
    reach: float  # how far the outline lies from the pose [m]
    solver_margin: float  # added to all [m]
    spreads: bool  # whether there is any noise in a plan


class PlanMargins(NamedTuple):
    """Margins beyond the radii that a plan keeps."""

    noise: Noise  # what those from obstacles follow from
    widest: float  # of any plan [m]: kept as it is where that is no hindrance
    far_clearance: float  # if every obstacle is farther away than the widest margin and this [m]
    side_margin: float  # from the sides of the area [m]
    path_clearance: Array  # (N,) what the path keeps from obstacles beyond the problem's margin [m]


class Numbers(NamedTuple):
    """What a pass writes of a QP, as views; and how references enter it."""

    places: Array
    """(entries that are written,) int32, where each lies: those by the states, those by commands
    from the youngest to the oldest, half-planes."""
    entries: Array  # written: of the matrix A
    dynamics_lower: Array  # written: (N, 3)
    dynamics_upper: Array  # written: (N, 3)
    half_plane_lower: Array  # written: (N, S)
    pull: Array  # written: (N, 3) of the linear cost
    start: Array  # written: (N (3 + m + 1),) the plan's states, commands, and slacks that it needs
    weight: Array  # (3, 3) by which references enter `pull`, at the stages before the last one ...
    weight_terminal: Array  # (3, 3) ... and at the last.
    turn: Array  # written: (N - 1,) of the quadratic cost: of each heading but the last
    turn_weight: float  # what it is where no way bends
    scale: float  # factor of the half-planes' rows
    open_bound: float  # bound of a half-plane that is not needed, less than all others


class Iterate(NamedTuple):
    """What a pass is linearised at, and what it steers for."""

    states: Array  # (N + 1, 3), the first is the present one
    inputs: Array  # (N, m)
    reference: Array  # (N + 1, 3)
    speeds: Array  # (N, 2) of the inputs, and turn rates
    to_goal: bool  # whether the reference is the goal itself at every stage


class Around(NamedTuple):
    """What a plan is kept out of; its points are the middles of the outline's circles."""

    things: Array  # (M, 7) what is round
    points: Array  # (N E, 2) at stages 1 to N
    gaps: Array  # (N E, S) distances of these from solids [m] ...
    away: Array
    """(N E, S, 2) ... and slopes by a pose's coordinates; (N E, S, 3) of a robot not round."""


class Timed(NamedTuple):
    """Poses along a path, at the times at which they can be reached."""

    poses: Array  # (K, 3) from the turn at the start to the one at the goal, K > 1
    times: Array  # (K,) from zero on, growing [s]; the last turn begins at the last but one
    cusps: Array  # (n,) when the robot stops and drives on in the other gear [s]
    step: float  # time between poses among which the robot's place is looked for [s]
    braking: float  # how long the robot brakes at the end of a leg [s]


def poses_at(path: Timed, times: Array) -> Array:
    """Poses (n, 3) at times (n,) [s]; the ends are held."""
    poses = np.empty((len(times), STATES))
    # as complex numbers, for both coordinates are interpolated in the time of one
    places = np.interp(times, path.times, path.poses[:, 0] + 1j * path.poses[:, 1])
    poses[:, :2] = places.view(float).reshape(-1, 2)
    poses[:, 2] = np.interp(times, path.times, path.poses[:, 2])
    return poses


def leg_end(path: Timed, begin: float) -> float:
    """When the gear changes next after a time [s]; infinite if it does not."""
    later = path.cusps[path.cusps > begin]
    return float(later[0]) if len(later) else math.inf


class Brakes(NamedTuple):
    """How a robot brakes."""

    step: Array  # (m,) by how much a braked command may shrink in a period
    faster: Array  # (m,) by how much commands may change in a period, away from zero ...
    slower: Array  # (m,) ... and towards it.
    curvature: float  # largest one that wheels can be steered to [1/m]
    longest: int  # most periods of a brake
    further: int  # how many further commands of a plan are tried


class Motions(NamedTuple):
    """Candidates, the best first."""

    commands: Array  # (C, T, m), to zero
    strict: Bits  # (C,) whether each must keep its margins, whatever clearance a standing robot has
    turns: Bits  # (C,) whether it begins with a slow turn on the spot
    ends: NDArray[np.intc]  # (C,) after how many periods it commands zero for good


def samples_a_period(longest: float, radius: float) -> int:
    """How many samples of a longest step [m] have chords that are short beside a radius [m]."""
    return min(max(math.ceil(longest / max(0.25 * radius, TINY)), 1), MOST_SAMPLES)


COLUMNS = 7
RADIUS, SPREAD_RATE, SPREAD_MAX = 2, 5, 6
PLACE, VELOCITY, SPREAD = slice(0, 2), slice(3, 5), slice(5, 7)


def things_of(circles: Array, spread_rate: Array | float = 0.0, most: float = 0.0) -> Array:
    """Things (M, 7) of circles (M, 5) that spread at a rate (M,) [m/s], up to a length [m]."""
    things = np.zeros((len(circles), COLUMNS))
    things[:, :SPREAD_RATE] = circles
    things[:, SPREAD_RATE] = spread_rate
    things[:, SPREAD_MAX] = most
    return things


def some_move(things: Array) -> bool:
    """Whether any of things (M, 7) has a velocity."""
    # a third of the time of `any`
    return bool(np.count_nonzero(things[:, VELOCITY]))


def some_spread(things: Array) -> bool:
    """Whether any of things (M, 7) grows: its velocity was seen, not given."""
    return bool(np.count_nonzero(things[:, SPREAD_RATE]))


def later(things: Array, time: float) -> Array:
    """Things (M, 7) as they are a time from now [s]; the very same array where all stand."""
    if not (some_move(things) or some_spread(things)):
        return things
    after = things.copy()
    after[:, PLACE] += time * things[:, VELOCITY]
    grown = np.minimum(time * things[:, SPREAD_RATE], things[:, SPREAD_MAX])
    after[:, RADIUS] += grown
    after[:, SPREAD_MAX] -= grown
    return after


def distances(things: Array, points: Array, times: Array) -> Array:
    """Distances of points at times from the edges of all things, negative inside, (n, M) [m].

    `things`: (M, 7). `points`, `times`: (n, 2) [m] and (n,) [s], from now.
    """
    x = points[:, :1] - things[:, 0]
    y = points[:, 1:] - things[:, 1]
    if some_move(things):
        x -= times[:, None] * things[:, 3]
        y -= times[:, None] * things[:, 4]
    found: Array = np.hypot(x, y, out=x)
    found -= things[:, RADIUS]
    if some_spread(things):
        found -= np.minimum(times[:, None] * things[:, SPREAD_RATE], things[:, SPREAD_MAX])
    return found
