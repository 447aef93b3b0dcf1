"""Trajectories: what a pass starts from and ends at, and the guesses that steps begin with."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.input_checks import POSITION_LIMIT
from kmpc_lite.control.nmpc.qp import LOST_TURN, NavigationQP
from kmpc_lite.control.options import fastest
from kmpc_lite.geometry import nearest_turn
from kmpc_lite.model.arguments import windows
from kmpc_lite.types import Array

ROUNDING = 1e-9  # by which a command may pass its bound
FARTHEST = 2 * POSITION_LIMIT
"""From the robot, in its own units, and in its turns [rad]: a plan that leads farther is spoilt."""


class Trajectory(NamedTuple):
    """States, commands and multipliers: an iterate, and a warm start."""

    states: Array  # (N + 1, 3), the first is the present one
    inputs: Array  # (N, 2)
    duals: Array  # (m,) multipliers of the QP's rows


def at_rest(qp: NavigationQP, pose: Array) -> Trajectory:
    """Trajectory of a robot that stands at a pose (3,): a cold start."""
    n = qp.horizon
    return Trajectory(np.tile(pose, (n + 1, 1)), np.zeros((n, qp.inputs)), qp.duals_in_the_open())


def along(qp: NavigationQP, reference: Array, pose: Array) -> Trajectory:
    """Trajectory of a robot that follows a reference (N + 1, 3) from a pose (3,) as it can."""
    dt, n = qp.problem.dt, qp.horizon
    away = reference - pose
    far = np.hypot(away[:, 0], away[:, 1])
    reach = fastest(qp.problem)[0] * dt * np.arange(n + 1)
    states = pose + np.minimum(reach / np.maximum(far, ROUNDING), 1.0)[:, None] * away
    steps = np.diff(states, axis=0)
    cos, sin = np.cos(states[:-1, 2]), np.sin(states[:-1, 2])
    moves = [cos * steps[:, 0] + sin * steps[:, 1], steps[:, 2]]
    if qp.inputs > len(moves):
        moves.insert(1, cos * steps[:, 1] - sin * steps[:, 0])
    inputs = np.column_stack(moves) / dt
    return Trajectory(states, qp.problem.within_bounds(inputs), qp.duals_in_the_open())


def one_period_later(qp: NavigationQP, last: Trajectory | None, here: Array) -> Trajectory | None:
    """Last plan, one period later, if the robot is where that plan put it.

    `qp`: shifts multipliers; its problem has the radius and the command bounds. `last`: the last
    plan; its last stage is held. `here`: present pose (3,), its heading within one turn. Returns
    None for a plan that is stale, or spoilt by whoever got it.
    """
    if last is None:
        return None
    dx, dy, turned = (last.states[1] - here).tolist()
    turns = nearest_turn(turned) if abs(turned) <= POSITION_LIMIT else 0.0
    lost = qp.lost
    # also false for NaN
    if not (abs(dx) <= lost and abs(dy) <= lost and abs(turned - turns) <= LOST_TURN):
        return None
    states = np.concatenate([here[None], last.states[2:], last.states[-1:]])
    inputs = np.concatenate([last.inputs[1:], last.inputs[-1:]])
    duals = qp.shift_duals(last.duals)
    # also false for NaN
    if not (
        np.maximum.reduce(np.abs(states - here), axis=None) <= FARTHEST
        and np.maximum.reduce(np.abs(inputs), axis=None) <= qp.fastest + ROUNDING
        and math.isfinite(np.add.reduce(duals))
    ):
        return None
    if turns:
        states[1:, 2] -= turns
    return Trajectory(states, inputs, duals)


def command_windows(history: int, past: Array, inputs: Array) -> Array | None:
    """Commands before each stage, oldest first, (N, L, 2); none for a model without history.

    `history`: how many past commands the model depends on, L. `past`: (L, 2) commands already sent,
    oldest first. `inputs`: (N, 2) planned commands.
    """
    if not history:
        return None
    return windows(np.concatenate([past, inputs]), history)
