"""From a linearisation to the numbers of the QP: half-planes with their margins, and the cost."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.nmpc.exact_hessian import hessians
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.sqp_state import Progress
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.options import SolverOptions
from kmpc_lite.control.world.half_planes import KeepOut
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.types import Array


class Linearized(NamedTuple):
    """One pass's QP, and where it starts."""

    lin: Linearization
    local: Array
    """(N + 1, 3) the guess around the origin of the QP."""
    violation: Array
    """(N,) of the half-planes by the guess [m]."""
    cost: Array | None
    """Entries of P; None where they are those that the QP was made with."""


class QPFiller:
    """Fills the QP of one problem.

    Parameters
    ----------
    qp : NavigationQP
        Written to.
    keep_out : KeepOut
        Finds the half-planes.
    exact_hessian : bool
        Whether passes may use the exact Hessian.
    options : SolverOptions
        When they do.
    """

    def __init__(
        self, qp: NavigationQP, keep_out: KeepOut, exact_hessian: bool, options: SolverOptions
    ) -> None:
        self._qp, self._keep_out = qp, keep_out
        self._exact_hessian, self._options = exact_hessian, options

    def fill(self, run: Progress, task: Task, lin: Linearization) -> Linearized:
        """Write the QP of a pass: dynamics, half-planes and cost, around the origin.

        Parameters
        ----------
        run : Progress
            Its guess is where the model was linearised; margins are written.
        task : Task
            Reference, obstacles and margins.
        lin : Linearization
            At the guess.
        """
        guess, qp, keep_out = run.guess, self._qp, self._keep_out
        found = keep_out.clearances(guess.states, task.things, task.solids)
        clearances, normals = found.values, found.normals
        if task.tightening is not None:
            run.margins = self._margins(guess, task, lin, clearances, normals, found.obstacle_count)
            clearances = keep_out.tighten(guess.states, task.things, found, run.margins)
        violation = np.maximum(-clearances.min(axis=1, initial=0.0), 0.0)
        local = guess.states - run.origin
        normals, offsets = keep_out.half_planes(local, clearances, normals)
        reference = task.reference - run.origin
        centred = lin._replace(value=lin.value - run.origin)
        shares = keep_out.shares()
        qp.fill(centred, local, guess.inputs, reference, normals, offsets, shares)
        if not self._exact_hessian:
            whole = qp.cost.terminal_share == 1.0
            return Linearized(lin, local, violation, None if whole else qp.P.data)
        stages, terminal = qp.cost.stage_cost, qp.cost.terminal_cost
        if self._wants_exact_hessian(run):
            bends = keep_out.bends(guess.states, task.things)
            stages, terminal = hessians(
                task.model, qp, guess.states, guess.inputs, guess.duals, normals, bends
            )
        qp.cost.fill(stages, terminal, local, guess.inputs)
        return Linearized(lin, local, violation, qp.P.data)

    def _wants_exact_hessian(self, run: Progress) -> bool:
        """Whether Gauss-Newton gets on badly: after a shortened step, later in every other pass."""
        late = run.passes >= self._options.gauss_newton_passes and run.passes % 2 == 0
        return run.passes > 0 and (run.length < 1.0 or late)

    def _margins(
        self,
        guess: Trajectory,
        task: Task,
        lin: Linearization,
        clearances: Array,
        normals: Array,
        count: int,
    ) -> Array:
        """Margins (N, K) [m] of the first `count` columns, obstacles, and of the sides."""
        tightening, drift = task.tightening, task.drift
        assert tightening is not None and drift is not None
        margins = np.empty(clearances.shape)
        margins.fill(tightening.side_margin)
        if not count:
            return margins
        widest = tightening.widest(drift)
        if np.minimum.reduce(clearances[:, :count], axis=None) < widest + tightening.far_clearance:
            margins[:, :count] = tightening.margins(
                drift,
                lin,
                guess.states,
                guess.inputs,
                normals[:, :count],
                task.path_clearance,
                self._keep_out.chord_radii(len(task.things), count),
            )
        else:
            margins[:, :count] = widest
        return margins
