"""How far a robot spreads around its plan: the covariance of its position, stage by stage.

Each stage feels the noise of the periods before, carried on by the model's Jacobians: without
feedback for as long as commands take to act, then under the feedback that later steps give, which
has forgotten what is older than `MEMORY` more periods (`kmpc_lite.model.tube`, shared with
calibration). White noise of each period is a column of its own; what is alike in all periods is one
column, to which each of them adds.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.margins.model_noise import FeltNoise, ModelNoise, factor
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.model.tube import MEMORY, closed_loop, rotations
from kmpc_lite.types import STATES, Array


class TubeSpread:
    """Computes the spread of plans; holds the memory for it.

    Parameters
    ----------
    noise : ModelNoise
        Of the model that linearises the plans.
    directions : int
        How many coordinates of the state are asked for: 2 for the position, 3 with the heading.
    """

    def __init__(self, noise: ModelNoise, directions: int = 2) -> None:
        self._directions = directions
        tube = noise.tube
        self._pose = factor(tube.pose)
        self._pose_by_speed = factor(tube.pose_by_speed) if tube.pose_by_speed.any() else None
        self._delay = noise.delay
        self._doublings = max(int(MEMORY).bit_length() - 1, 0)
        self._wide = np.empty((0, STATES, 0))

    def factors(self, felt: FeltNoise, lin: Linearization, states: Array, inputs: Array) -> Array:
        """Factors F of the covariances ``F F'``: half the work, and never indefinite.

        Parameters
        ----------
        felt : FeltNoise
            Inflated by the drift detector.
        lin : Linearization
            At `states[:-1]` and `inputs`.
        states, inputs : ndarray
            The plan: (N + 1, 3) and (N, 2).

        Returns
        -------
        ndarray
            (N, `directions`, C), at stages 1 to N; overwritten by the next call.
        """
        headings = states[:-1, 2]
        cos, sin = np.cos(headings), np.sin(headings)
        turned = rotations(cos, sin)
        by_command = inputs.repeat(STATES, axis=1)[:, None]
        added = turned @ (felt.plan_factor * by_command)
        jacobians = closed_loop(lin.A, cos, sin)
        width, steered = added.shape[2], added.shape[2] << self._doublings
        fresh = steered + self._delay * width
        wide = self._memory(len(inputs), fresh, felt)
        for column in range(steered, fresh, width):
            wide[..., column : column + width] = added
            added = _carried(lin.A, added)
        wide[..., :width] = added
        kept, parts = None, []
        if felt.lasting_factor is not None:
            kept = turned @ (felt.lasting_factor * by_command)
            for _ in range(self._delay):
                parts.append(kept)
                kept = _carried(lin.A, kept)
        # doubling: beside what m periods have spread, what the m periods before them did, moved on
        # by m periods
        span = 1
        for level in range(self._doublings):
            if span >= len(wide):
                break
            earlier = wide[:-span, :, :width]
            np.matmul(jacobians[span:], earlier, out=wide[span:, :, width : 2 * width])
            if kept is not None:
                kept[span:] += jacobians[span:] @ kept[:-span]
            if level + 1 < self._doublings:
                longer = jacobians.copy()
                np.matmul(jacobians[span:], jacobians[:-span], out=longer[span:])
                jacobians = longer
            width, span = 2 * width, 2 * span
        if kept is not None:
            wide[..., -kept.shape[2] :] = sum(parts, kept)
        rows = self._directions
        np.matmul(turned[:, :rows], self._pose, out=wide[:, :rows, fresh : fresh + STATES])
        if self._pose_by_speed is not None:
            by_speed = wide[:, :rows, fresh + STATES : fresh + 2 * STATES]
            np.matmul(turned[:, :rows], self._pose_by_speed * inputs[:, :1, None], out=by_speed)
        return wide[:, :rows]

    def _memory(self, stages: int, fresh: int, felt: FeltNoise) -> Array:
        """Give room for the columns: noise first, then the pose's, then what lasts."""
        columns = fresh + (STATES if self._pose_by_speed is None else 2 * STATES)
        columns += 0 if felt.lasting_factor is None else felt.lasting_factor.shape[1]
        if self._wide.shape != (stages, STATES, columns):
            self._wide = np.zeros((stages, STATES, columns))
        return self._wide

    def covariances(
        self, felt: FeltNoise, lin: Linearization, states: Array, inputs: Array
    ) -> Array:
        """Covariances (N, 2, 2) of the position at stages 1 to N [m^2]; arguments as `factors`."""
        factors = self.factors(felt, lin, states, inputs)[:, :2]
        out: Array = factors @ factors.transpose(0, 2, 1)
        return out


def _carried(jacobians: Array, columns: Array) -> Array:
    """Columns (N, 3, c) that stages hold, carried on by a period: none at the first stage."""
    out = np.zeros_like(columns)
    np.matmul(jacobians[1:], columns[:-1], out=out[1:])
    return out
