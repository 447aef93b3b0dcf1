"""What the Gauss-Newton QP leaves out of the Hessian of the Lagrangian: how the dynamics and the circles bend, stage by stage.

Passes to convergence use it where they get on badly without: they oscillate where the robot turns
while it drives, and creep along circles. The blocks are made convex by turning negative eigenvalues
round (Verschueren et al. 2017 discuss such regularisations).
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.nmpc.qp import KEEPOUT_SCALE, NavigationQP
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

PAIR = STATES + INPUTS
STEP = 1e-4
"""Of the central differences of the model's Jacobians [m, rad, m/s, rad/s]."""
LEAST = 0.1
"""Smallest curvature of a stage in any direction: steps stay finite."""


def hessians(
    model: KoopmanModel,
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
    model : KoopmanModel
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
    stages, terminal = qp.stage_cost.copy(), qp.terminal_cost.copy()
    stages -= dynamics_curvature(model, states[:-1], inputs, duals[qp.dynamics_rows])
    # the distance to a circle bends across the normal; its multipliers are negative, those of lower
    # bounds
    weights = KEEPOUT_SCALE * duals[qp.keepout_rows] * bends
    across = np.stack([-normals[..., 1], normals[..., 0]], axis=-1)
    around = np.einsum("ns,nsc,nsd->ncd", weights, across, across)
    stages[1:, :2, :2] += around[:-1]
    terminal[:2, :2] += around[-1]
    stages[0, :STATES, STATES:] = stages[0, STATES:, :STATES] = 0.0
    return convex(stages), convex(terminal)


def dynamics_curvature(
    model: KoopmanModel, states: Array, inputs: Array, multipliers: Array
) -> Array:
    """Second derivatives (N, 5, 5) of ``multipliers . f(x, u)`` at states (N, 3) and inputs (N, 2), by central differences."""
    points = np.concatenate([states, inputs], axis=1)
    moves = STEP * np.concatenate([np.eye(PAIR), -np.eye(PAIR)])
    around = points + moves[:, None]
    lin = model.linearize(around[..., :STATES], around[..., STATES:])
    slopes = np.einsum("ni,mnij->nmj", multipliers, np.concatenate([lin.A, lin.B], axis=-1))
    hessian = (slopes[:, :PAIR] - slopes[:, PAIR:]) / (4.0 * STEP)
    curvature: Array = hessian + hessian.transpose(0, 2, 1)
    return curvature


def convex(blocks: Array) -> Array:
    """Symmetric matrices (..., n, n) with the absolute values of their eigenvalues, and none below `LEAST`."""
    values, vectors = np.linalg.eigh(blocks)
    turned: Array = (vectors * np.maximum(np.abs(values), LEAST)[..., None, :]) @ vectors.swapaxes(
        -1, -2
    )
    return turned
