"""Trajectories: what a pass starts from and ends at, and the guesses that steps begin with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.control.kernels.clearance import PLACE
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.geometry import angle_swept
from kmpc_lite.model.arguments import windows
from kmpc_lite.types import INPUTS, Array


@dataclass(frozen=True, eq=False, slots=True)
class Trajectory:
    """States, commands and multipliers: an iterate, and a warm start."""

    states: Array
    """(N + 1, 3), the first is the present one."""
    inputs: Array
    """(N, 2)."""
    duals: Array
    """(m,) multipliers of the QP's rows."""


def at_rest(qp: NavigationQP, pose: Array) -> Trajectory:
    """Trajectory of a robot that stands at a pose (3,): a cold start."""
    n = qp.horizon
    return Trajectory(np.tile(pose, (n + 1, 1)), np.zeros((n, INPUTS)), qp.duals_in_the_open())


def shifted(qp: NavigationQP, last: Trajectory, pose: Array) -> Trajectory:
    """Trajectory one period later, from the measured pose (3,); its last stage is held."""
    states = np.concatenate([pose[None], last.states[2:], last.states[-1:]])
    inputs = np.concatenate([last.inputs[1:], last.inputs[-1:]])
    return Trajectory(states, inputs, qp.shift_duals(last.duals))


def along(qp: NavigationQP, reference: Array, pose: Array) -> Trajectory:
    """Trajectory of a robot that follows a reference (N + 1, 3) from a pose (3,)."""
    states = reference.copy()
    states[0] = pose
    steps = np.diff(states, axis=0)
    forward = np.cos(states[:-1, 2]) * steps[:, 0] + np.sin(states[:-1, 2]) * steps[:, 1]
    inputs = np.column_stack([forward, steps[:, 2]]) / qp.problem.dt
    return Trajectory(states, qp.problem.within_bounds(inputs), qp.duals_in_the_open())


def command_windows(history: int, past: Array, inputs: Array) -> Array | None:
    """Commands before each stage, oldest first, (N, L, 2); none for a model without history.

    Parameters
    ----------
    history : int
        How many past commands the model depends on, L.
    past : ndarray
        (L, 2) commands already sent, oldest first.
    inputs : ndarray
        (N, 2) planned commands.
    """
    if not history:
        return None
    return windows(np.concatenate([past, inputs]), history)


def leads_elsewhere(states: Array, reference: Array, things: Array) -> bool:
    """Whether states (N + 1, 3) pass one of things (M, 7) on another side than a reference.

    There and back, by way of the reference, they then lead around it.
    """
    loop = np.concatenate([states[:, :2], reference[::-1, :2], states[:1, :2]])
    return bool((np.abs(angle_swept(loop, things[:, PLACE])) > np.pi).any())
