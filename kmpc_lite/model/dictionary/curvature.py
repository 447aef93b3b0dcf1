"""Curvature that a car's commands steer to: wheels that stand still stay as they are."""

from __future__ import annotations

import numpy as np

from kmpc_lite.types import Array

STANDS = 1e-9
"""Speed below which a command says nothing of how the wheels are steered [m/s]."""


def held_curvatures(commands: Array) -> Array:
    """Curvatures (..., T) [1/m] of commands v, omega (..., T, 2) in order of time.

    A command that stands keeps the curvature before it; before the first that drives it is zero.

    Examples
    --------
    >>> held_curvatures(np.array([(0.0, 0.0), (2.0, 1.0), (0.0, 0.0)]))
    array([0. , 0.5, 0.5])
    """
    v, omega = commands[..., 0], commands[..., 1]
    drives = np.abs(v) > STANDS
    found = np.where(drives, omega, 0.0) / np.where(drives, v, 1.0)
    if drives.all():
        return found
    last = np.maximum.accumulate(np.where(drives, np.arange(v.shape[-1]), 0), axis=-1)
    held: Array = np.take_along_axis(found, last, axis=-1)
    return held
