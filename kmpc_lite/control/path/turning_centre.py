"""The point about which the robot turns on the spot, read out of its model.

The pose may be tracked at another point: a marker or an antenna off the axle's middle, or the
middle of a skid-steer robot whose weight lies off it. A turn on the spot then moves the pose on a
circle. What drives like a unicycle is the turning centre, so paths are planned for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import rotate
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array

CENTRE_HEADINGS = 8
"""At so many headings the model is asked how a turn moves the pose."""
CENTRE_DISTANCE = 0.004
"""A turning centre nearer to the tracked pose than this is taken to be the tracked pose [m]."""
CENTRE_CERTAINTY = 3.5
"""A turning centre counts only where it lies this many of its standard errors away from the tracked
pose."""
CENTRE_SHARE = 1.0
"""A turning centre counts only where it explains this many times as much of the predicted motion as
it leaves unexplained."""
TINY = 1e-12
"""Variance of a turn that is none [rad^2]: rounding."""


def turning_centre(model: MotionModel, problem: NavigationProblem) -> Array | None:
    """Place of the turning centre as seen from the tracked pose, by the model.

    How the model moves the pose with the turn rate, at several headings, is what a turn about a
    point that is fixed to the robot does: least squares in its two coordinates.

    `model`: with an input history, once a command has been held that long. `problem`: command
    bounds. Returns (2,) ahead and to the left [m]; None if it is the pose itself, or where the
    motion is no turn about a point.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> turning_centre(nominal_unicycle(0.1), NavigationProblem()) is None
    True
    """
    poses, at_rest = np.zeros((CENTRE_HEADINGS, STATES)), np.zeros((CENTRE_HEADINGS, model.inputs))
    poses[:, 2] = math.tau / CENTRE_HEADINGS * np.arange(CENTRE_HEADINGS) - math.pi
    past = at_rest[:, None].repeat(model.history, axis=1)
    lin = model.linearize(poses, at_rest, past)
    moved = (lin.B + lin.B_past.sum(axis=1))[..., -1]
    ahead, left = rotate(moved[:, 0], moved[:, 1], -poses[:, 2])
    turned = moved[:, 2]
    weight = float(turned @ turned)
    # steered wheels turn nothing where they stand
    held = np.zeros((2, model.inputs))
    held[:, -1] = problem.u_min[-1], problem.u_max[-1]
    ends = model.predict(np.zeros((2, STATES)), held, held[:, None].repeat(model.history, axis=1))
    if not 0.0 < weight < np.inf or ends[0, 2] == ends[1, 2]:
        return None
    # turning by a little moves the pose across its arm from the point
    point: Array = np.array([-turned @ left, turned @ ahead]) / weight
    explained = weight * float(point @ point)
    unexplained = float(ahead @ ahead + left @ left) - explained
    least = max(CENTRE_DISTANCE**2, CENTRE_CERTAINTY**2 * _variance(model, problem))
    # the comparisons are also false for NaN
    if not (point @ point >= least and explained >= CENTRE_SHARE * unexplained):
        return None
    return _without_gains(model, point)


def _variance(model: MotionModel, problem: NavigationProblem) -> float:
    """Square of the error [m^2] with which the model's log shows the turning centre.

    Each step of the log, driven at half the bounds, tells of the point by how far it turns.
    """
    u_min, u_max, _, _ = problem.bounds
    usual = 0.5 * np.maximum(u_max, -u_min)
    turned = float(usual[-1]) * model.dt
    samples = float(model.info.get("samples", 1))
    noise = float(np.trace(model.noise(usual)[:2, :2]))
    return 0.5 * noise / max(turned * turned * samples, TINY)


def _without_gains(model: MotionModel, point: Array) -> Array:
    """Take out of a point (2,) the gains that were learned while driving.

    They stretch displacements and turns alike, and cannot know where on the robot it turns.
    """
    adapted = model.info.get("adaptation")
    if not isinstance(adapted, Mapping):
        return point
    ahead, left, turn = (
        float(adapted.get(name, default))
        for name, default in (("ahead", 1.0), ("left", 0.0), ("turn", 1.0))
    )
    stretched: Array = turn * np.linalg.solve([[ahead, -left], [left, ahead]], point)
    return stretched


def seen_from(poses: Array, point: Array) -> Array:
    """Poses (..., 3) of a point (2,) of the robot, ahead and to the left [m].

    Given are the poses of the robot itself; the opposite point leads back.
    """
    seen: Array = poses.copy()
    x, y = rotate(point[0], point[1], poses[..., 2])
    seen[..., 0] += x
    seen[..., 1] += y
    return seen


def point_of(pose: Array, point: Array) -> Array:
    """Give what `seen_from` does for a single pose (3,): plain floats are faster there."""
    x, y, heading = pose.tolist()
    ahead, left = point.tolist()
    dx, dy = rotate(float(ahead), float(left), float(heading))
    return np.array((x + dx, y + dy, heading))


def swing(centre: Array | None) -> float:
    """How far the tracked pose lies from the turning centre (2,) [m]; none: it is the centre."""
    return 0.0 if centre is None else math.hypot(*centre)
