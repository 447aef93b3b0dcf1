"""From a linearisation and what is around a plan to the numbers of a pass's QP.

Half-planes keep each stage out of the nearest few obstacles and sides, margins away from them. The
QP is solved around the robot's place, so that its relative tolerance does not depend on where the
map has its origin. Sizes: N stages, at most 50; m commands; L past ones, at most 8; S slots.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.kernels import half_planes
from kmpc_lite.control.kernels.tube import Noise, tube_margins
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.types import Array


class PlanMargins(NamedTuple):
    """Margins beyond the radii that a plan keeps."""

    noise: Noise
    """What those from obstacles follow from."""
    widest: float
    """Of any plan [m]: kept as it is where that is no hindrance."""
    far_clearance: float
    """If every obstacle is farther away than the widest margin and this [m]."""
    side_margin: float
    """From the sides of the area [m]."""
    path_clearance: Array
    """(N,) what the path keeps from obstacles beyond the problem's margin [m]."""


class Numbers(NamedTuple):
    """What a pass writes of a QP, as views; and how references enter it."""

    places: Array
    """(entries that are written,) int32, where each lies: those by the states, those by commands
    from the youngest to the oldest, half-planes."""
    entries: Array
    """Written: of the matrix A."""
    dynamics_lower: Array
    """Written: (N, 3)."""
    dynamics_upper: Array
    """Written: (N, 3)."""
    half_plane_lower: Array
    """Written: (N, S)."""
    pull: Array
    """Written: (N, 3) of the linear cost."""
    start: Array
    """Written: (N (3 + m + 1),) the plan's states, commands, and slacks that it needs."""
    weight: Array
    """(3, 3) by which references enter `pull`, at the stages before the last one ..."""
    weight_terminal: Array
    """(3, 3) ... and at the last."""
    scale: float
    """Factor of the half-planes' rows."""
    open_bound: float
    """Bound of a half-plane that is not needed, less than all others."""


class Iterate(NamedTuple):
    """What a pass is linearised at, and what it steers for."""

    states: Array
    """(N + 1, 3), the first is the present one."""
    inputs: Array
    """(N, m)."""
    reference: Array
    """(N + 1, 3)."""
    speeds: Array
    """(N, 2) of the inputs, and turn rates."""


class Around(NamedTuple):
    """What a plan is kept out of; its points are the middles of the outline's circles."""

    things: Array
    """(M, 7) what is round."""
    points: Array
    """(N E, 2) at stages 1 to N."""
    gaps: Array
    """(N E, S) distances of these from solids [m] ..."""
    away: Array
    """(N E, S, 2) ... and directions away from them."""


def fill(
    keep: half_planes.KeepOut,
    margins: PlanMargins | None,
    numbers: Numbers,
    lin: Linearization,
    plan: Iterate,
    around: Around,
) -> None:
    """Write a pass into a QP.

    Parameters
    ----------
    keep, margins, numbers
        What follows from the problem; none without margins; what is written.
    lin : Linearization
        The model's at the plan.
    plan, around
        The plan, and what it is kept out of.
    """
    states = plan.states
    found, normals = half_planes.clearances(keep, states, *around)
    if margins is not None:
        count = found.shape[1] - len(keep.side_offsets) - (keep.range < np.inf)
        found -= _margins(margins, count, lin, plan, found, normals)
    origin = states[0] * (1.0, 1.0, 0.0)
    local = states - origin
    violation = np.maximum(-found.min(axis=1, initial=0.0), 0.0)
    np.concatenate([local[1:].ravel(), plan.inputs.ravel(), violation], out=numbers.start)
    chosen, offsets = half_planes.nearest_half_planes(local, found, normals, keep.slots)
    _write(numbers, lin._replace(value=lin.value - origin), local, plan.inputs, chosen, offsets)
    np.matmul(plan.reference[1:-1] - origin, numbers.weight, out=numbers.pull[:-1])
    np.matmul(plan.reference[-1] - origin, numbers.weight_terminal, out=numbers.pull[-1])


def _margins(
    margins: PlanMargins,
    count: int,
    lin: Linearization,
    plan: Iterate,
    clearances: Array,
    normals: Array,
) -> Array:
    """Margins (N, K) [m] of the obstacles, the first `count` columns, and of the sides."""
    found = np.full(clearances.shape, margins.side_margin)
    if not count:
        return found
    nearest = np.minimum.reduce(clearances[:, :count], axis=None)
    if nearest < margins.widest + margins.far_clearance:
        found[:, :count] = tube_margins(
            margins.noise,
            lin.A,
            plan.states,
            plan.speeds,
            normals[:, :count],
            margins.path_clearance,
        )
    else:
        found[:, :count] = margins.widest
    return found


def _write(
    numbers: Numbers, lin: Linearization, x: Array, u: Array, normals: Array, offsets: Array
) -> None:
    """Write dynamics and half-planes.

    Rows are ``x+ - A x - sum_j B_j u_j = f - A x0 - sum_j B_j u0_j``: what is known moves to the
    right.
    """
    value, by_x, by_u, by_past = lin
    stages, history = len(u), by_past.shape[1]
    right = value - (by_u @ u[..., None])[..., 0]
    right[1:] -= (by_x[1:] @ x[1:-1, :, None])[..., 0]
    blocks = [by_x[1:].ravel(), by_u.ravel()]
    for j in range(1, min(history, stages - 1) + 1):
        by_age = by_past[j:, j - 1]
        blocks.append(by_age.ravel())
        right[j:] -= (by_age @ u[: stages - j, :, None])[..., 0]
    written = np.concatenate([*blocks, -numbers.scale * normals.ravel()])
    numbers.entries[numbers.places] = np.negative(written, out=written)
    numbers.dynamics_lower[:] = right
    numbers.dynamics_upper[:] = right
    np.maximum(numbers.scale * offsets, -numbers.open_bound, out=numbers.half_plane_lower)
