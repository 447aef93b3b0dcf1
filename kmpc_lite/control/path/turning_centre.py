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
from kmpc_lite.types import Array

CENTRE_HEADINGS = 8
"""At so many headings the model is asked for a turn on the spot, to either side."""
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

    What the model predicts for turns on the spot at several headings is compared with circles about
    a point that is fixed to the robot: least squares in its two coordinates.

    `model`: with an input history it is asked for what it does once a command has been held that
    long. `problem`: command bounds. Returns (2,) ahead and to the left [m]; None if it is the pose
    itself, or where the motion is no turn about a point.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> turning_centre(nominal_unicycle(0.1), NavigationProblem()) is None
    True
    """
    cos, sin, dx, dy = _turns(model, problem, CENTRE_HEADINGS)
    weight = float(cos @ cos + sin @ sin)
    if not 0.0 < weight < np.inf:
        return None
    point: Array = np.array([cos @ dx + sin @ dy, cos @ dy - sin @ dx]) / weight
    explained = weight * float(point @ point)
    unexplained = float(dx @ dx + dy @ dy) - explained
    least = max(CENTRE_DISTANCE**2, CENTRE_CERTAINTY**2 * _variance(model, problem))
    # the comparisons are also false for NaN
    if not (point @ point >= least and explained >= CENTRE_SHARE * unexplained):
        return None
    return _without_gains(model, point)


def _turns(
    model: MotionModel, problem: NavigationProblem, headings: int
) -> tuple[Array, Array, Array, Array]:
    """Turns on the spot to both sides, compared at each heading.

    Returns `cos`, `sin`, `dx`, `dy`: (H,) each: by how much cosine and sine of the heading after a
    left turn are less than after a right turn, and by how much farther the pose has moved [m]. What
    is the same for both turns is no turn; a turn about a point moves the pose by (R(before) -
    R(after)) point.
    """
    u_min, u_max, _, _ = problem.bounds
    commands = np.zeros((2, headings, model.inputs))
    commands[:, :, -1] = [[u_min[-1]], [u_max[-1]]]
    before = math.tau / headings * np.arange(headings) - math.pi
    poses = np.zeros((2, headings, 3))
    poses[..., 2] = before
    history = np.repeat(commands[:, :, None], model.history, axis=2)
    moved = model.predict(poses, commands, history) - poses
    after = before + moved[..., 2]
    cos, sin = -np.diff(np.cos(after), axis=0).ravel(), -np.diff(np.sin(after), axis=0).ravel()
    dx, dy = np.diff(moved[..., :2], axis=0).reshape(-1, 2).T
    return cos, sin, dx, dy


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
