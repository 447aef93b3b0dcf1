"""Cars' logs: steering angles become turn rates, and what no motor has obeyed is left out.

A car's command is a speed and a steering angle. Its turn rate is ``v tan(angle) / wheelbase``; the
wheelbase need not be known, since the log shows how far the car turns on each metre. A driver with
a deadman switch commands speeds that nothing obeys until it is pressed.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import rotate
from kmpc_lite.types import Array

PIECE = 1.0
"""Time over which driven and turned are compared [s]: a servo's lag is short beside it."""
LEAST_TURNED = 1.0
"""Sum of the turns that tell a wheelbase [rad]."""
COMMANDED, OBEYED = 0.2, 0.15
"""A command of more than this share of the largest speed is not obeyed if the robot drives less
than this share of it ..."""
DISOBEYED = 1.0
"""... for so long [s]."""
EASES = 0.5
"""What is left out beside that [s]: motors start and stop."""


def find_wheelbase(time: Array, poses: Array, angles: Array) -> float:
    """Wheelbase [m] by which steering angles (n,) [rad] explain how poses (n, 3) turn.

    Angles that steer to the other side give a wheelbase below zero.

    Raises
    ------
    DataError
        If the log turns too little to tell.
    """
    driven, turned, slopes = _pieces(time, poses, np.tan(angles))
    bent = driven * slopes
    if np.abs(turned).sum() < LEAST_TURNED or not bent @ turned:
        raise DataError("steering: the log turns too little to tell the wheelbase: drive circles")
    return float(bent @ bent / (bent @ turned))


def _pieces(time: Array, poses: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Distance ahead, turn, and mean slope of pieces of a log."""
    known = np.isfinite(slopes) & np.isfinite(poses).all(axis=1)
    time, poses, slopes = time[known], poses[known], slopes[known]
    heading = np.unwrap(poses[:, 2])
    ahead, _ = rotate(np.diff(poses[:, 0]), np.diff(poses[:, 1]), -heading[:-1])
    steps = np.diff(time)
    held = steps < PIECE  # what is left out of a log is no drive
    number = np.floor((time[:-1] - time[0]) / PIECE).astype(int)
    count = int(number.max(initial=0)) + 1
    total = np.bincount(number, held * steps, count)

    def summed(values: Array) -> Array:
        out: Array = np.bincount(number, np.where(held, values, 0.0), count)
        return out

    mean = summed(slopes[:-1] * steps) / np.maximum(total, 1e-9)
    used = total > 0.5 * PIECE
    return summed(ahead)[used], summed(np.diff(heading))[used], mean[used]


def disobeyed(time: Array, poses: Array, speeds: Array) -> Array:
    """Which rows (n,) of a log lie in stretches whose commanded speeds (n,) nothing obeys.

    Parameters
    ----------
    time, poses, speeds : ndarray
        (n,) [s], (n, 3), and (n,) commanded [m/s], NaN if none was.
    """
    asked = np.nan_to_num(np.abs(speeds))
    window = time[:, None] + np.array((-0.5, 0.5)) * DISOBEYED
    places = [np.interp(window, time, column) for column in poses[:, :2].T]
    driven = np.hypot(*(np.diff(place, axis=1)[:, 0] for place in places)) / DISOBEYED
    largest = np.quantile(asked, 0.99)
    ignored = (asked > COMMANDED * largest) & (driven < OBEYED * asked)
    out = np.zeros(len(time), dtype=bool)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], ignored.astype(int), [0]])))
    for first, last in edges.reshape(-1, 2):
        if time[last - 1] - time[first] >= DISOBEYED:
            out |= (time >= time[first] - EASES) & (time <= time[last - 1] + EASES)
    return out
