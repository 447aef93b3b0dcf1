"""The point about which the robot turns on the spot, read out of its model.

The pose may be tracked at another point: a marker or an antenna off the axle's middle, or the
middle of a skid-steer robot whose weight lies off it. A turn on the spot then moves the pose on a
circle. What drives like a unicycle is the turning point, so ways are planned for it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, Array

HEADINGS = 8
"""Headings at which the model is asked for a turn, to either side."""
LEAST = 0.004
"""Nearer to the pose than this [m] the point is taken to be the pose: parking allows for as
much."""
CERTAIN = 3.5
"""How many times its standard error away from the pose the point must be: noise of the log alone
moves it so far once in hundreds."""
CIRCLE = 1.0
"""How many times what it leaves unexplained a circle must explain: a model may move the pose in
turns for other reasons."""
SAME = 0.001
"""A model that moves the point by less [m] is taken to mean the same one."""


def turning_centre(model: KoopmanModel, problem: NavigationProblem) -> Array | None:
    """Place of the turning point as seen from the tracked pose, by the model.

    What the model predicts for turns on the spot at several headings is compared with circles about
    a point that is fixed to the robot: least squares in its two coordinates.

    Parameters
    ----------
    model : KoopmanModel
        With an input history it is asked for what it does once a command has been held that long.
    problem : NavigationProblem
        Command bounds.

    Returns
    -------
    ndarray or None
        (2,) ahead and to the left [m]; None where it is the pose itself, or nothing that a circle
        explains.

    Examples
    --------
    >>> from kmpc_lite import nominal_unicycle
    >>> turning_centre(nominal_unicycle(0.1), NavigationProblem()) is None
    True
    """
    u_min, u_max, _, _ = problem.bounds
    commands = np.zeros((2, HEADINGS, INPUTS))
    commands[:, :, 1] = [[u_min[1]], [u_max[1]]]
    before = 2 * np.pi / HEADINGS * np.arange(HEADINGS) - np.pi
    poses = np.zeros((2, HEADINGS, 3))
    poses[..., 2] = before
    moved = (
        model.predict(poses, commands, np.repeat(commands[:, :, None], model.history, axis=2))
        - poses
    )
    # what is the same for both turns is no turn; a turn about a point moves the pose by (R(before)
    # - R(after)) point
    cos, sin = (
        -np.diff(np.cos(before + moved[..., 2]), axis=0).ravel(),
        -np.diff(np.sin(before + moved[..., 2]), axis=0).ravel(),
    )
    dx, dy = np.diff(moved[..., :2], axis=0).reshape(-1, 2).T
    weight = float(cos @ cos + sin @ sin)
    if not 0.0 < weight < np.inf:
        return None
    point: Array = np.array([cos @ dx + sin @ dy, cos @ dy - sin @ dx]) / weight
    explained = weight * float(point @ point)
    left = float(dx @ dx + dy @ dy) - explained
    # the error with which a log of as many steps shows the point, at half the bounds: each step
    # tells of it by how far it turns
    usual = 0.5 * np.maximum(u_max, -u_min)
    turned = float(usual[1]) * model.dt
    variance = (
        0.5
        * float(np.trace(model.noise(usual)[:2, :2]))
        / max(turned * turned * float(model.info.get("samples", 1)), 1e-12)
    )
    # also false for NaN
    if not (point @ point >= max(LEAST**2, CERTAIN**2 * variance) and explained >= CIRCLE * left):
        return None
    adapted = model.info.get("adaptation")
    if isinstance(adapted, Mapping):
        # gains learned while driving stretch displacements and turns alike; they cannot know where
        # on the robot it turns
        ahead, left, turn = (
            float(adapted.get(name, default))
            for name, default in (("ahead", 1.0), ("left", 0.0), ("turn", 1.0))
        )
        point = turn * np.linalg.solve([[ahead, -left], [left, ahead]], point)
    return point


def seen_from(poses: Array, point: Array) -> Array:
    """Poses (..., 3) of a point of the robot (2,), ahead and to the left [m], where its own are given; the opposite point leads back."""
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    out: Array = poses.copy()
    out[..., 0] += cos * point[0] - sin * point[1]
    out[..., 1] += sin * point[0] + cos * point[1]
    return out


def point_of(pose: Array, point: Array) -> Array:
    """Give what `seen_from` does for a single pose (3,): plain floats are faster there."""
    x, y, heading = pose.tolist()
    ahead, left = point.tolist()
    cos, sin = math.cos(heading), math.sin(heading)
    return np.array((x + cos * ahead - sin * left, y + sin * ahead + cos * left, heading))
