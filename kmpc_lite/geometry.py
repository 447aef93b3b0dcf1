"""Angles, rotations, arcs and distances: once for the whole package.

Every function takes scalars as well as arrays. A Python float goes through `math`, which is many
times faster for one number than NumPy. Lengths are in m, angles in rad, times in s.
"""

from __future__ import annotations

import math
from typing import overload

import numpy as np

from kmpc_lite.types import Array

Pose = tuple[float, float, float]  # a pose (x [m], y [m], theta [rad]) in plain floats


@overload
def wrap(angle: float) -> float: ...
@overload
def wrap(angle: Array) -> Array: ...
def wrap(angle: float | Array) -> float | Array:
    """Bring angles into [-pi, pi) by whole turns.

    `angle`: any angle, or angles of any shape [rad]. Returns the same angles, in [-pi, pi) [rad];
    NaN where they are not finite.

    Examples
    --------
    >>> wrap(7.0) == 7.0 - 2.0 * math.pi, wrap(math.pi) == -math.pi
    (True, True)
    """
    wrapped = (angle + math.pi) % math.tau - math.pi
    # just below -pi, the remainder rounds up to a whole turn
    if isinstance(wrapped, float):
        return -math.pi if wrapped >= math.pi else wrapped
    wrapped[wrapped >= math.pi] = -math.pi
    return wrapped


@overload
def nearest_turn(angle: float) -> float: ...
@overload
def nearest_turn(angle: Array) -> Array: ...
def nearest_turn(angle: float | Array) -> float | Array:
    """Whole turns nearest to an angle: 2 pi round(angle / 2 pi).

    A heading that counts its turns is brought near zero by subtracting them, and back by adding
    them; what is computed between does not change with the number of turns.

    `angle`: any finite angle, or angles of any shape [rad]. Returns multiples of 2 pi [rad].

    Examples
    --------
    >>> nearest_turn(7.0) == 2.0 * math.pi, nearest_turn(-3.0)
    (True, 0.0)
    """
    if isinstance(angle, float | int):
        return math.tau * round(angle / math.tau)
    return math.tau * np.round(angle / math.tau)


@overload
def rotate(x: float, y: float, heading: float) -> tuple[float, float]: ...
@overload
def rotate(x: Array, y: Array, heading: float | Array) -> tuple[Array, Array]: ...
@overload
def rotate(x: float, y: float, heading: Array) -> tuple[Array, Array]: ...
def rotate(
    x: float | Array, y: float | Array, heading: float | Array
) -> tuple[float | Array, float | Array]:
    """Turn vectors counter-clockwise; of a robot's own axes, into the world's.

    `x`, `y`: components of the vectors [any unit]. `heading`: angle by which they turn [rad];
    shapes broadcast. Returns components of the turned vectors.

    Examples
    --------
    >>> [round(value, 9) for value in rotate(1.0, 0.0, math.pi / 2.0)]
    [0.0, 1.0]
    """
    cos, sin = (
        (math.cos(heading), math.sin(heading))
        if isinstance(heading, float)
        else (np.cos(heading), np.sin(heading))
    )
    return cos * x - sin * y, sin * x + cos * y


def seen_along(differences: Array, headings: Array) -> Array:
    """Differences of poses along and across a heading, and of the heading.

    `differences`: one pose minus another (..., 3) [m, m, rad]. `headings`: headings along which
    they are seen (...) [rad]. Returns (..., 3): ahead [m], to the left [m], and the turn [rad] as
    it is.

    Examples
    --------
    >>> seen_along(np.array([1.0, 0.0, 0.1]), np.array(math.pi / 2.0)).round(9)
    array([ 0. , -1. ,  0.1])
    """
    ahead, left = rotate(differences[..., 0], differences[..., 1], -headings)
    return np.stack([ahead, left, differences[..., 2]], axis=-1)


@overload
def exact_arc(pose: Pose, v: float, omega: float, t: float, left: float = 0.0) -> Pose: ...
@overload
def exact_arc(
    pose: Array, v: float | Array, omega: float | Array, t: float | Array, left: float | Array = 0.0
) -> Array: ...
def exact_arc(
    pose: Pose | Array,
    v: float | Array,
    omega: float | Array,
    t: float | Array,
    left: float | Array = 0.0,
) -> Pose | Array:
    """Move poses at speeds that are constant in the robot's frame: exactly, on arcs.

    The chord of an arc lies half of the turn off the first heading, and is sinc(turn / 2) times
    as long as the arc.

    `pose`: where the arcs begin: (x, y, theta), or an array (..., 3) [m, m, rad]. `v`, `omega`:
    forward speed [m/s] and turn rate [rad/s], of shapes that broadcast with pose[..., 0]. `t`: time
    on the arc [s]; shapes broadcast. `left`: speed to the left [m/s], of a robot that slips
    sideways. Returns poses at the end, as `pose` was given: (x, y, theta), or (..., 3) of all
    shapes broadcast.

    Examples
    --------
    >>> [round(value, 3) for value in exact_arc((0.0, 0.0, 0.0), 1.0, math.pi, 0.5)]
    [0.318, 0.318, 1.571]
    """
    if isinstance(pose, tuple):
        turn = float(omega * t)
        half = 0.5 * turn
        chord = float(t) * (math.sin(half) / half if half else 1.0)
        along, across = rotate(chord * float(v), chord * float(left), pose[2] + half)
        return pose[0] + along, pose[1] + across, pose[2] + turn
    turns = np.asarray(omega * t)
    chords = t * np.sinc(turns / math.tau)
    forward, sideways = rotate(chords * v, chords * left, pose[..., 2] + 0.5 * turns)
    ends = np.broadcast_arrays(
        pose[..., 0] + forward, pose[..., 1] + sideways, pose[..., 2] + turns
    )
    return np.stack(ends, axis=-1)


def distances(points: Array, others: Array) -> Array:
    """Distances between the positions of points or poses, one by one.

    `points`, `others`: points (..., 2) or poses (..., 3) [m], of shapes that broadcast but for the
    last axis. Returns distances (...) [m].

    Examples
    --------
    >>> float(distances(np.array([3.0, 4.0, 1.0]), np.zeros(2)))
    5.0
    """
    apart: Array = np.hypot(points[..., 0] - others[..., 0], points[..., 1] - others[..., 1])
    return apart


def angle_swept(points: Array, centres: Array) -> Array:
    """Angle (M,) by which a path through points (K, 2) goes around each centre [rad]."""
    away = points[:, None] - centres
    angle = np.arctan2(away[..., 1], away[..., 0])
    swept: Array = wrap(np.diff(angle, axis=0)).sum(axis=0)
    return swept


def heading_of(qx: float | Array, qy: float | Array, qz: float | Array, qw: float | Array) -> Array:
    """Heading of the robot's x axis, from quaternions of any length [rad]."""
    turned: Array = np.arctan2(2.0 * (qw * qz + qx * qy), qw**2 + qx**2 - qy**2 - qz**2)
    return turned
