"""What is remarkable in a log's poses: jumps, stand-stills, and that they come seldom.

They are reported though the log is learned from. A pose that is repeated to the last digit while
the robot is commanded to move is no new one.
"""

from __future__ import annotations

import numpy as np

from kmpc_lite.geometry import wrap
from kmpc_lite.learn.cutting import GAP
from kmpc_lite.learn.logs import Log
from kmpc_lite.learn.motion import speeds_of
from kmpc_lite.types import Array

JUMP = 10.0
"""Ratio of a step to the largest speed asked, and to nearly all other steps."""
USUAL = 0.95
"""Share of the steps that are nearly all."""
STANDING = 0.1
"""Share of the largest command below which a robot may stand."""
LATE = 1.5
"""Periods of a model that may pass between two new poses of a moving robot."""
LOST = 3.0
"""Time for which a robot is commanded to move while its pose stands still [s]."""


def tell_poses(log: Log, dt: float) -> list[str]:
    """What is remarkable in the poses, one line each.

    `log`: in SI units. `dt`: the model's period [s].
    """
    time, poses = log.poses.time, log.poses.values
    new = np.concatenate([[True], np.any(np.diff(poses, axis=0) != 0.0, axis=1)])
    rows = np.flatnonzero(new)
    if len(rows) < 20:
        return []
    asked = _asked(log, time)
    told = _tell_repeats(log, dt, rows, asked)
    steps = np.diff(poses[rows], axis=0)
    sizes = {"position": np.hypot(steps[:, 0], steps[:, 1]), "heading": np.abs(wrap(steps[:, 2]))}
    for k, (name, size) in enumerate(sizes.items()):
        unit = ("m", "rad")[k]
        told += _tell_jumps(log, rows, size, float(asked[:, k].max()), (name, unit))
    return told


def _asked(log: Log, time: Array) -> Array:
    """Sizes of the commands that hold at each pose (n, 2)."""
    told = np.abs(speeds_of(log))
    if log.together:
        return told
    order = np.argsort(log.commands.time, kind="stable")
    at = np.searchsorted(log.commands.time[order], time, side="right") - 1
    return told[order][np.maximum(at, 0)]


def _tell_repeats(log: Log, dt: float, rows: Array, asked: Array) -> list[str]:
    """Lines on poses that come seldom, or not at all for a while, though the robot should move."""
    time = log.poses.time
    moving = np.any(asked > STANDING * asked.max(axis=0), axis=1)
    still = np.concatenate([[0], np.cumsum(~moving)])
    steps = np.diff(time[rows])
    driven = (still[rows[1:]] == still[rows[:-1]]) & (steps > 0.0)
    if driven.sum() < 20:
        return []
    every = float(np.median(steps[driven]))
    period = float(np.median(np.diff(time)))
    if np.diff(rows)[driven].max() > 1 and every > LATE * dt:
        return [
            f"poses of the moving robot change every {every:.2g} s only, though logged every "
            f"{period:.2g} s: what lies between is old, and learned as lateness; --dt {every:.2g}"
        ]
    held = np.clip(np.diff(time), 0.0, GAP * period) * moving[:-1]
    told = np.diff(np.concatenate([[0.0], np.cumsum(held)])[rows])
    lost = (np.diff(rows) > 1) & (told > LOST)
    if not lost.any():
        return []
    longest = int(np.argmax(told * lost))
    return [
        f"{log.where(int(rows[longest]))}: the pose does not change for {steps[longest]:.3g} s, in "
        f"which the robot is commanded to move ({int(lost.sum())} such): blocked, or its pose was "
        "lost; cut that out"
    ]


def _tell_jumps(
    log: Log, rows: Array, size: Array, asked: float, named: tuple[str, str]
) -> list[str]:
    """A line on steps between new poses that are far larger than all others and than asked."""
    steps = np.diff(log.poses.time[rows])
    period = float(np.median(steps))
    whole = (steps > 0.0) & (steps <= GAP * period)
    if not whole.any():
        return []
    usual = float(np.quantile(size[whole], USUAL))
    jumps = whole & (size > JUMP * np.maximum(usual, asked * steps))
    if not jumps.any():
        return []
    k = int(np.argmax(np.where(jumps, size, 0.0)))
    name, unit = named
    return [
        f"{log.where(int(rows[k + 1]))}: the {name} jumps by {size[k]:.3g} {unit} in "
        f"{steps[k]:.2g} s ({int(jumps.sum())} such jumps), where {asked:.2g} {unit}/s is the most "
        "that is asked: outliers or a frame that was moved widen the margins; cut them out"
    ]
