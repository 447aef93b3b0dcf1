"""What a model cannot explain: the covariance of its one-step residual, by command."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.files import real_array
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.noise_sources import NoiseSources
from kmpc_lite.types import STATES, Array

LARGEST = 1e12
"""Values of a model beyond this [SI units] are damage: products of them overflow."""


@dataclass(frozen=True)
class NoiseModel:
    """Covariance of the one-step residual in the robot's frame, as a function of the command.

    ``cov(u) = S[0] + S[1] v^2 + S[2] omega^2`` for (forward [m], left [m], heading [rad]), each S
    symmetric and positive semidefinite, (3, 3).
    """

    coefficients: Array
    sources: NoiseSources | None = None
    """What the covariance comes from, where a log was long enough to tell."""

    def check(self) -> None:
        """Raise ModelError unless the coefficients are three covariances."""
        s = real_array(self.coefficients, "model noise", ModelError)
        if s.shape != (3, STATES, STATES) or not (np.abs(s) <= LARGEST).all():
            raise ModelError(
                f"model noise: expected finite values of shape (3, 3, 3), got {s.shape}"
            )
        tolerance = 1e-9 * np.abs(s).max()
        if (
            np.abs(s - s.transpose(0, 2, 1)).max() > tolerance
            or np.linalg.eigvalsh(s).min() < -tolerance
        ):
            raise ModelError("model noise: expected symmetric positive semidefinite matrices")
        if self.sources is not None:
            self.sources.check()

    def covariance(self, u: Array) -> Array:
        """Covariances (..., 3, 3) for commands (..., m)."""
        u = speeds(u)
        terms = np.stack([np.ones(u.shape[:-1]), u[..., 0] ** 2, u[..., 1] ** 2], axis=-1)
        covariance: Array = np.tensordot(terms, self.coefficients, axes=(-1, 0))
        return covariance
