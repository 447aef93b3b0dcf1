"""How far a robot spreads around its plan: the covariance of its position, stage by stage.

Each stage feels the noise of the last `MEMORY` periods, carried on by the model's Jacobians under
the feedback that later steps give (`kmpc_lite.model.tube`, shared with calibration).
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.margins.model_noise import FeltNoise, ModelNoise
from kmpc_lite.model.koopman import Linearization
from kmpc_lite.model.tube import MEMORY, closed_loop, rotations
from kmpc_lite.types import STATES, Array


class TubeSpread:
    """Computes the spread of plans; holds the memory for it.

    Parameters
    ----------
    noise : ModelNoise
        Of the model that linearises the plans.
    """

    def __init__(self, noise: ModelNoise) -> None:
        self._measured_factor = noise.measured_factor
        # a robot that lags takes nothing back within the memory
        self._feedback = not noise.lagging
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
            (N, 2, C), of the position at stages 1 to N; overwritten by the next call.
        """
        headings = states[:-1, 2]
        cos, sin = np.cos(headings), np.sin(headings)
        turned = rotations(cos, sin)
        width, span = felt.plan_factor.shape[1], 1
        if len(self._wide) != len(inputs):
            self._wide = np.zeros((len(inputs), STATES, (width << self._doublings) + STATES))
        wide = self._wide
        own_noise = felt.plan_factor * inputs.repeat(STATES, axis=1)[:, None]
        np.matmul(turned, own_noise, out=wide[..., :width])
        jacobians = closed_loop(lin.A, cos, sin, self._feedback)
        # doubling: beside what m periods have spread, what the m periods before them did, moved on
        # by m periods
        for level in range(self._doublings):
            if span >= len(wide):
                break
            earlier = wide[:-span, :, :width]
            np.matmul(jacobians[span:], earlier, out=wide[span:, :, width : 2 * width])
            if level + 1 < self._doublings:
                longer = jacobians.copy()
                np.matmul(jacobians[span:], jacobians[:-span], out=longer[span:])
                jacobians = longer
            width, span = 2 * width, 2 * span
        np.matmul(turned[:, :2], self._measured_factor, out=wide[:, :2, -STATES:])
        return wide[:, :2]

    def covariances(
        self, felt: FeltNoise, lin: Linearization, states: Array, inputs: Array
    ) -> Array:
        """Covariances (N, 2, 2) of the position at stages 1 to N [m^2]; arguments as `factors`."""
        factors = self.factors(felt, lin, states, inputs)
        out: Array = factors @ factors.transpose(0, 2, 1)
        return out
