"""From a linearisation and half-planes to the numbers of a pass's QP."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array


def fill(
    value: Array,
    by_x: Array,
    by_u: Array,
    by_past: Array,
    x: Array,
    u: Array,
    normals: Array,
    offsets: Array,
    places: Array,
    entries: Array,
    dynamics_lower: Array,
    dynamics_upper: Array,
    half_plane_lower: Array,
    scale: float,
    open_bound: float,
) -> None:
    """Write one linearisation and its half-planes into a QP.

    Its rows are ``x+ - A x - sum_j B_j u_j = f - A x0 - sum_j B_j u0_j``: what is known moves to
    the right. Sizes: N stages, at most 50; m commands; L past ones, at most 8; S slots.

    Parameters
    ----------
    value, by_x, by_u, by_past : ndarray
        (N, 3), (N, 3, 3), (N, 3, m), (N, L, 3, m) of the model at the plan.
    x, u : ndarray
        The plan: (N + 1, 3) and (N, m).
    normals, offsets : ndarray
        (N, S, 2 or 3), (N, S).
    places : ndarray
        (entries that are written,) int32, where each lies: those by the states, those by commands
        from the youngest to the oldest, half-planes.
    entries : ndarray
        Written: of the matrix A.
    dynamics_lower, dynamics_upper, half_plane_lower : ndarray
        Written: (N, 3), (N, 3), (N, S).
    scale : float
        Factor of the half-planes' rows.
    open_bound : float
        Bound of a half-plane that is not needed, less than all others.
    """
    stages, history = len(u), by_past.shape[1]
    right = value - (by_u @ u[..., None])[..., 0]
    right[1:] -= (by_x[1:] @ x[1:-1, :, None])[..., 0]
    blocks = [by_x[1:].ravel(), by_u.ravel()]
    for j in range(1, min(history, stages - 1) + 1):
        by_age = by_past[j:, j - 1]
        blocks.append(by_age.ravel())
        right[j:] -= (by_age @ u[: stages - j, :, None])[..., 0]
    written = np.concatenate([*blocks, -scale * normals.ravel()])
    entries[places] = np.negative(written, out=written)
    dynamics_lower[:] = right
    dynamics_upper[:] = right
    np.maximum(scale * offsets, -open_bound, out=half_plane_lower)
