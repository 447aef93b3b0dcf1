"""What the Gauss-Newton QP leaves out of the Hessian: how dynamics and circles bend.

Passes to convergence use it where they get on badly without: they oscillate where the robot turns
while it drives, and creep along circles. The blocks are made convex by turning negative eigenvalues
round (Verschueren et al. 2017 discuss such regularisations).
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import INPUTS, STATES, Array

PAIR = STATES + INPUTS
STEP = 1e-4
"""Of the central differences of the model's Jacobians [m, rad, m/s, rad/s]."""


def hessians(
    model: MotionModel,
    qp: NavigationQP,
    states: Array,
    inputs: Array,
    duals: Array,
    normals: Array,
    bends: Array,
) -> tuple[Array, Array]:
    """Convex Hessians of the Lagrangian by each stage's state and command, and by the last state.

    Parameters
    ----------
    model : MotionModel
        Without input history: the command of a stage then bends nothing but the next state.
    qp : NavigationQP
        Its cost, and its rows.
    states, inputs, duals : ndarray
        The iterate: (N + 1, 3), (N, 2), (m,).
    normals, bends : ndarray
        Of the half-planes of stages 1 to N: (N, slots, 2), and (N, slots) what turns per metre
        [1/m].

    Returns
    -------
    stages, terminal : ndarray
        (N, 5, 5) and (3, 3); in the first only the block of the command is meant, for its state is
        given.
    """
    stages, terminal = qp.cost.stage_cost.copy(), qp.cost.terminal_cost.copy()
    stages -= dynamics_curvature(model, states[:-1], inputs, duals[qp.dynamics_rows])
    # the distance to a circle bends across the normal; its multipliers are negative, those of lower
    # bounds
    weights = qp.half_plane_scale * duals[qp.half_plane_rows] * bends
    across = np.stack([-normals[..., 1], normals[..., 0]], axis=-1)
    around = np.einsum("ns,nsc,nsd->ncd", weights, across, across)
    stages[1:, :2, :2] += around[:-1]
    terminal[:2, :2] += around[-1]
    stages[0, :STATES, STATES:] = stages[0, STATES:, :STATES] = 0.0
    least = qp.least_curvature
    return convex(stages, least), convex(terminal, least)


def dynamics_curvature(
    model: MotionModel, states: Array, inputs: Array, multipliers: Array
) -> Array:
    """Second derivatives (N, 5, 5) of ``multipliers . f(x, u)``, by central differences.

    Parameters
    ----------
    model : MotionModel
        f.
    states, inputs, multipliers : ndarray
        (N, 3), (N, 2), (N, 3).
    """
    points = np.concatenate([states, inputs], axis=1)
    moves = STEP * np.concatenate([np.eye(PAIR), -np.eye(PAIR)])
    around = points + moves[:, None]
    lin = model.linearize(around[..., :STATES], around[..., STATES:])
    slopes = np.einsum("ni,mnij->nmj", multipliers, np.concatenate([lin.A, lin.B], axis=-1))
    hessian = (slopes[:, :PAIR] - slopes[:, PAIR:]) / (4.0 * STEP)
    curvature: Array = hessian + hessian.transpose(0, 2, 1)
    return curvature


def convex(blocks: Array, least: float) -> Array:
    """Symmetric matrices (..., n, n) with the absolute values of their eigenvalues, or `least`."""
    values, vectors = np.linalg.eigh(blocks)
    positive = np.maximum(np.abs(values), least)
    turned: Array = (vectors * positive[..., None, :]) @ vectors.swapaxes(-1, -2)
    return turned
