"""From a linearisation to the numbers of the QP: half-planes with their margins, and the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.world.half_planes import Clearances, KeepOut
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.types import Array


class Filled(NamedTuple):
    """What the filled QP starts from, and what was seen on the way."""

    origin: Array
    """(3,) around which the QP is solved, so that its relative tolerance does not depend on where
    the map has its origin."""
    local: Array
    """(N + 1, 3) states of the guess around it."""
    violation: Array
    """(N,) of the half-planes by the guess [m]."""


def fill_qp(
    qp: NavigationQP,
    keep_out: KeepOut,
    task: Task,
    lin: Linearization,
    states: Array,
    inputs: Array,
) -> Filled:
    """Write the QP of a pass: dynamics, half-planes and cost, around the robot.

    Parameters
    ----------
    qp : NavigationQP
        Written to.
    keep_out : KeepOut
        Finds the half-planes.
    task : Task
        Reference, obstacles and margins.
    lin : Linearization
        At the guess.
    states, inputs : ndarray
        The guess: (N + 1, 3), (N, 2).
    """
    found = keep_out.clearances(states, task.things, task.solids)
    clearances = found.values
    if task.tightening is not None:
        clearances -= _margins(task, lin, states, inputs, found)
    violation = np.maximum(-clearances.min(axis=1, initial=0.0), 0.0)
    origin = states[0] * (1.0, 1.0, 0.0)
    local = states - origin
    normals, offsets = keep_out.half_planes(local, clearances, found.normals)
    centred = lin._replace(value=lin.value - origin)
    qp.fill(centred, local, inputs, task.reference - origin, normals, offsets)
    return Filled(origin, local, violation)


def _margins(
    task: Task,
    lin: Linearization,
    states: Array,
    inputs: Array,
    found: Clearances,
) -> Array:
    """Margins (N, K) [m] of the obstacles, the first columns, and of the sides."""
    tightening, felt, count = task.tightening, task.felt, found.obstacle_count
    assert tightening is not None and felt is not None
    margins = np.empty(found.values.shape)
    margins.fill(tightening.side_margin)
    if not count:
        return margins
    nearest = np.minimum.reduce(found.values[:, :count], axis=None)
    if nearest < felt.widest + tightening.far_clearance:
        margins[:, :count] = tightening.margins(
            felt, lin, states, inputs, found.normals[:, :count], task.path_clearance
        )
    else:
        margins[:, :count] = felt.widest
    return margins
