"""How the errors of a learned model spread along a plan that is steered back at every step.

Shared by calibration, which measures such errors on held-out drives, and by tightening, which keeps
room for them. In zero-order robust optimisation (Zanelli et al. 2021, zoRO) the spread is computed
at the last plan and stays outside the QP.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.model.koopman import KoopmanModel, NoiseModel
from kmpc_lite.types import Array

MEMORY = 8
"""Steps of noise that a stage still feels, a power of two. The feedback has forgotten the older
ones: after 8 steps the spread is within 1 % of its limit at 0.3 m/s and more, and when slower there
is little noise to add up."""
FORWARD, LATERAL, TURN = 0.5, 0.2, 0.5
"""What the assumed feedback takes away in one step: shares of the forward and of the heading error,
and the gain by which a lateral error turns the robot back, as the share of itself that it is then
reduced by per step at speed."""
STILL = 0.03
"""Below this displacement per step [m] the lateral feedback fades: a robot that stands cannot move
sideways."""
FLOOR = 1e-4
"""Standard deviation [m, rad] that is added to every noise: a model that fits to rounding has no
smaller one."""


def closed_loop(by_state: Array, cos: Array, sin: Array, feedback: bool = True) -> Array:
    """Jacobians of one step under feedback, for deviations from the plan.

    Parameters
    ----------
    by_state : ndarray
        The model's derivative by the state, (..., 3, 3).
    cos, sin : ndarray
        Of the planned heading, (...).
    feedback : bool
        False for a model with input history: its commands act too late to take anything back within
        the first steps.

    Returns
    -------
    ndarray
        (..., 3, 3).
    """
    out: Array = by_state.copy()
    if not feedback:
        return out
    # how far sideways a unit of heading error leads, and from it the gain by which a lateral error
    # is steered back
    drift = cos * out[..., 1, 2] - sin * out[..., 0, 2]
    gain = LATERAL * drift / (drift * drift + STILL * STILL)
    half = FORWARD * cos
    out[..., 0, 0] -= half * cos
    half = half * sin
    out[..., 0, 1] -= half
    out[..., 1, 0] -= half
    out[..., 1, 1] -= FORWARD * (sin * sin)
    out[..., 2, 0] += gain * sin
    out[..., 2, 1] -= gain * cos
    out[..., 2, 2] -= TURN
    return out


def rotations(cos: Array, sin: Array) -> Array:
    """Matrices (..., 3, 3) from the robot's frame to the map's."""
    out = np.zeros((*cos.shape, 3, 3))
    out[..., 0, 0] = out[..., 1, 1] = cos
    out[..., 1, 0] = sin
    out[..., 0, 1] = -sin
    out[..., 2, 2] = 1.0
    return out


def split_noise(noise: NoiseModel | None) -> tuple[Array, Array]:
    """Part the learned covariance into what the pose measurement adds and what the floor does.

    A robot that stands does not move, so what the residuals have left at zero command comes from
    the measured poses at both ends: it does not add up along a plan. What grows with the commands
    does.

    Returns
    -------
    measured, moved : ndarray
        (3, 3), and (2, 3, 3) to be multiplied by v^2 and omega^2.
    """
    floor = FLOOR**2 * np.eye(3)
    if noise is None:
        return floor, np.zeros((2, 3, 3))
    return noise.coefficients[0] + floor, noise.coefficients[1:]


def window_deviations(
    model: KoopmanModel, x: Array, u: Array, x_next: Array, history: Array | None
) -> tuple[Array, Array]:
    """Deviations of measured drives from plans under feedback, and their expected covariances.

    Parameters
    ----------
    model : KoopmanModel
        Predicts.
    x, u, x_next : ndarray
        Windows of consecutive steps: (n, S, 3), (n, S, 2), (n, S, 3).
    history : ndarray or None
        Commands before each step, (n, S, L, 2).

    Returns
    -------
    deviations, covariances : ndarray
        Of the position after 1 to S steps, in the map's frame: (n, S, 2) and (n, S, 2, 2).
    """
    lin = model.linearize(x, u, history)
    residual = x_next - lin.value
    cos, sin = np.cos(x[..., 2]), np.sin(x[..., 2])
    jacobians = closed_loop(lin.A, cos, sin, feedback=not model.history)
    turned = rotations(cos, sin)
    measured, moved = split_noise(model.noise_model)
    noise = turned @ np.tensordot(u * u, moved, axes=(-1, 0)) @ turned.swapaxes(-1, -2)
    still = turned @ measured @ turned.swapaxes(-1, -2)
    error = np.zeros((len(x), 3))
    spread = np.zeros((len(x), 3, 3))
    deviations, covariances = np.empty((*x.shape[:2], 2)), np.empty((*x.shape[:2], 2, 2))
    for k in range(x.shape[1]):
        step = jacobians[:, k]
        error = (step @ error[..., None])[..., 0] + residual[:, k]
        spread = step @ spread @ step.swapaxes(-1, -2) + noise[:, k]
        deviations[:, k] = error[:, :2]
        covariances[:, k] = (spread + still[:, k])[:, :2, :2]
    return deviations, covariances
