"""What a model cannot explain: the covariance of its one-step residual by command, and its sources.

After k periods an open-loop prediction from a measured pose errs with the variance ``R(v_0) +
R(v_k) + Q (sum of u^2) + D (sum of u dt)^2``: the pose's noise R at both ends does not grow (but
is larger at speed, for stamps jitter), white noise Q of the motion grows with time, gains that are
off for a while (D) grow with its square. Feedback takes back what has grown; what the pose's noise
adds it cannot tell from motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.files import real_array
from kmpc_lite.model.arguments import speeds
from kmpc_lite.types import INPUTS, STATES, Array

LARGEST = 1e12  # values of a model beyond this [SI units] are damage: products of them overflow


@dataclass(frozen=True)
class NoiseSources:
    """Variances in the robot's frame: forward, left, heading."""

    pose: Array  # of one measured pose at rest, (3,) [m^2, m^2, rad^2]
    pose_by_speed: Array
    """What is added to that by v^2, (3,): a stamp that jitters by 10 ms moves the pose by 10 ms
    times v."""
    white: Array
    """Of one period's motion, by v^2 and by omega^2, (2, 3): independent from period to period."""
    lasting: Array
    """Of the gains that are off for longer than a plan, by v and by omega, (2, 3): a forward one of
    0.01 means that distances come out 10 % longer or shorter, for a while."""

    def check(self) -> None:
        """Raise ModelError unless all are variances."""
        shapes = {
            "pose": (STATES,),
            "pose_by_speed": (STATES,),
            "white": (INPUTS, STATES),
            "lasting": (INPUTS, STATES),
        }
        for name, shape in shapes.items():
            values = real_array(getattr(self, name), f"model noise {name}", ModelError)
            if values.shape != shape or not (np.isfinite(values).all() and (values >= 0.0).all()):
                raise ModelError(
                    f"model noise {name}: expected variances of shape {shape}, got {values.shape}"
                )

    def as_array(self) -> Array:
        """All in one array, (6, 3): pose, pose by speed, white, lasting."""
        return np.concatenate([self.pose[None], self.pose_by_speed[None], self.white, self.lasting])

    @classmethod
    def from_array(cls, values: Array) -> NoiseSources:
        """Undo `as_array`."""
        if values.shape != (2 + 2 * INPUTS, STATES):
            raise ModelError(f"model noise sources: expected shape (6, 3), got {values.shape}")
        sources = cls(values[0], values[1], values[2 : 2 + INPUTS], values[2 + INPUTS :])
        sources.check()
        return sources


def design(inputs: Array, dt: float) -> Array:
    """What multiplies each source after each period, (..., T, 6): commands (..., T, 2)."""
    inputs = speeds(inputs)
    squares = np.cumsum(inputs**2, axis=-2)
    travelled = np.cumsum(inputs, axis=-2) * dt
    driven = inputs[..., :1] ** 2
    ends = np.concatenate([np.full_like(driven, 2.0), driven[..., :1, :] + driven], axis=-1)
    return np.concatenate([ends, squares, travelled**2], axis=-1)


def design_across(inputs: Array, dt: float) -> Array:
    """What multiplies the heading's sources in the variance across, (..., T, 6).

    An error of the heading leads the robot aside over the distance that it drives afterwards.
    """
    v, omega = np.moveaxis(speeds(inputs), -1, 0)
    travelled = np.cumsum(v, axis=-1) * dt
    # distance driven between the end of period j and the end of period k, for j <= k
    since = travelled[..., :, None] - travelled[..., None, :]
    since = np.where(np.tril(np.ones(since.shape[-2:], dtype=bool)), since, 0.0)
    return np.stack(
        [
            travelled**2,
            travelled**2 * v[..., :1] ** 2,
            (since**2 @ (v**2)[..., None])[..., 0],
            (since**2 @ (omega**2)[..., None])[..., 0],
            (since @ (v * dt)[..., None])[..., 0] ** 2,
            (since @ (omega * dt)[..., None])[..., 0] ** 2,
        ],
        axis=-1,
    )


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
