"""Where a model's errors come from: the measured pose, noise of the motion, and gains that are off.

After k periods an open-loop prediction from a measured pose errs with the variance ``2 R + Q (sum
of u^2) + D (sum of u dt)^2``: the pose's noise R at both ends does not grow, white noise Q of the
motion grows with time, gains that are off for a while (D) grow with its square. Feedback takes back
what has grown; what the pose's noise adds it cannot tell from motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import ModelError
from kmpc_lite.files import real_array
from kmpc_lite.types import INPUTS, STATES, Array


@dataclass(frozen=True)
class NoiseSources:
    """Variances in the robot's frame: forward, left, heading."""

    pose: Array
    """Of one measured pose, (3,) [m^2, m^2, rad^2]."""
    white: Array
    """Of one period's motion, by v^2 and by omega^2, (2, 3): independent from period to period."""
    lasting: Array
    """Of the gains that are off for longer than a plan, by v and by omega, (2, 3): a forward one of
    0.01 means that distances come out 10 % longer or shorter, for a while."""

    def check(self) -> None:
        """Raise ModelError unless all are variances."""
        shapes = {"pose": (STATES,), "white": (INPUTS, STATES), "lasting": (INPUTS, STATES)}
        for name, shape in shapes.items():
            values = real_array(getattr(self, name), f"model noise {name}", ModelError)
            if values.shape != shape or not (np.isfinite(values).all() and (values >= 0.0).all()):
                raise ModelError(
                    f"model noise {name}: expected variances of shape {shape}, got {values.shape}"
                )

    def as_array(self) -> Array:
        """All in one array, (5, 3): pose, white, lasting."""
        return np.concatenate([self.pose[None], self.white, self.lasting])

    @classmethod
    def from_array(cls, values: Array) -> NoiseSources:
        """Undo `as_array`."""
        if values.shape != (1 + 2 * INPUTS, STATES):
            raise ModelError(f"model noise sources: expected shape (5, 3), got {values.shape}")
        sources = cls(values[0], values[1 : 1 + INPUTS], values[1 + INPUTS :])
        sources.check()
        return sources

    def open_loop(self, inputs: Array, dt: float, measured: bool = True) -> Array:
        """Variances along, across and of the heading after each period, (..., T, 3).

        Parameters
        ----------
        inputs : ndarray
            Commands (..., T, 2).
        dt : float
            Period [s].
        measured : bool
            Whether the end is told by a measured pose, whose noise counts too.
        """
        terms = design(inputs, dt)
        heading = np.concatenate([[self.pose[2]], self.white[:, 2], self.lasting[:, 2]])
        position = [
            np.concatenate([[self.pose[i]], self.white[:, i], self.lasting[:, i]]) for i in range(2)
        ]
        out = np.stack([terms @ position[0], terms @ position[1], terms @ heading], axis=-1)
        out[..., 1] += design_across(inputs, dt) @ heading
        if not measured:
            out -= self.pose
        return out


def design(inputs: Array, dt: float) -> Array:
    """What multiplies each source after each period, (..., T, 5): commands (..., T, 2)."""
    squares = np.cumsum(inputs**2, axis=-2)
    travelled = np.cumsum(inputs, axis=-2) * dt
    return np.concatenate([np.full((*squares.shape[:-1], 1), 2.0), squares, travelled**2], axis=-1)


def design_across(inputs: Array, dt: float) -> Array:
    """What multiplies the heading's sources in the variance across, (..., T, 5).

    An error of the heading leads the robot aside over the distance that it drives afterwards.
    """
    v, omega = inputs[..., 0], inputs[..., 1]
    travelled = np.cumsum(v, axis=-1) * dt
    # distance driven between the end of period j and the end of period k, for j <= k
    since = travelled[..., :, None] - travelled[..., None, :]
    since = np.where(np.tril(np.ones(since.shape[-2:], dtype=bool)), since, 0.0)
    return np.stack(
        [
            travelled**2,
            (since**2 @ (v**2)[..., None])[..., 0],
            (since**2 @ (omega**2)[..., None])[..., 0],
            (since @ (v * dt)[..., None])[..., 0] ** 2,
            (since @ (omega * dt)[..., None])[..., 0] ** 2,
        ],
        axis=-1,
    )
