"""Cars' logs: steered wheels become turn rates, and what no motor has obeyed is left out.

A car's command is a speed and a steering angle, a curvature, or the position of a servo. Its turn
rate is speed times curvature. Neither wheelbase nor the servo's middle need be known, since the log
shows how far the car turns on each metre. A driver with a deadman switch commands speeds that
nothing obeys until it is pressed.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import rotate
from kmpc_lite.learn.formats.columns import CAR_OMEGA
from kmpc_lite.learn.logs import Log, Series
from kmpc_lite.model.dictionary.response import held_curvatures
from kmpc_lite.types import Array

PIECE = 1.0  # time over which driven and turned are compared [s]
LAGS = np.array((1e-9, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4, 0.6))
"""Time constants of the steering that are tried [s]."""
LEAST_TURNED, EXPLAINED = 1.0, 0.6
"""Sum of the turns that tell a wheelbase [rad]; share of the turns, squared, that steering must
explain: else they come of something else. Cars' logs have 0.87 and more, relocated poses and late
servos included."""
ON_THE_SPOT, STANDS = 0.1, 0.1
"""Share of the turns that may come in pieces in which the robot drives less than such a share of
the distance that it drives in a median one: no car turns where it stands."""
COMMANDED = 0.2  # share of the largest speed from which on a command is one to drive
SHARES, SLOWEST, LATEST = (0.1, 0.2, 0.4), 5.0, 0.3
"""A robot that takes the longest to the speed that is asked [s] passes each of these shares of it
in as large a share of that time, begun so late [s]; one that takes longer does not obey."""
WINDOW, EASES = 0.4, 0.5
"""Time over which a driven speed is measured [s]; what is left out beside what is not obeyed [s]:
motors start and stop."""
UNITS, REACHED = (0.2, 5.0), 0.98
"""Ratios of driven to asked speed, where it is largest but for this share, that are one of metres
to metres; others come of shares of full throttle, or of revolutions."""
JUMP = 3.0
"""Ratio of a pose's speed to the largest that is commanded from which on it has been relocated."""
ROLLS = 1e-6  # speed that stands for none [m/s]: wheels can be steered while they stand


def as_car(log: Log, wheelbase: float | None = None) -> Log:
    """Give a log of steered wheels as one of speeds and turn rates.

    `log`: its commands are a speed and a steering angle, a curvature, or a servo's position, as its
    `columns` say. `wheelbase`: distance between the axles [m], for angles; found if not given.
    Raises DataError if the log does not tell how its steering turns it.
    """
    if log.together and log.columns[1] == CAR_OMEGA:  # saved: as it was learned from
        return replace(log, columns=("v", "omega"), steered=True)
    time, poses, told = log.poses.time, log.poses.values, log.commands.values
    at = np.arange(len(time))
    if not log.together:
        at = np.searchsorted(log.commands.time, time, side="right") - 1
    held = told[np.maximum(at, 0)]
    left_out = disobeyed(time, poses, held[:, 0]) | _relocated(time, poses, held[:, 0])
    rows = np.flatnonzero(~left_out & (at >= 0))
    if len(rows) < 2:
        raise DataError("nothing obeyed the commands of this log")
    seen = time[rows], poses[rows], held[rows, 1]
    curvatures, how, geometry = _curvatures(log.columns[1], told, seen, wheelbase)
    speeds = np.where(np.abs(told[:, 0]) < ROLLS, ROLLS, told[:, 0])
    values = np.column_stack([speeds, speeds * curvatures])
    sharpest = float(np.abs(curvatures).max())
    radius = f"{1.0 / sharpest if sharpest > 0.0 else math.inf:.2f}"
    notes = [
        *log.notes,
        f"steered wheels, a car{how}; turning radius {radius} m: wheels = "
        f'{{kind = "car", turning_radius = {radius}}}',
    ]
    if left_out.any():
        seconds = np.diff(time, prepend=time[0])[left_out].sum()
        notes.append(
            f"{seconds:.0f} s in which nothing obeyed the commands, or the pose jumped, are left "
            "out"
        )
    commands = replace(log.commands, values=values)
    if log.together:
        commands = Series(commands.time[rows], values[rows], commands.source)
    return replace(
        log,
        poses=Series(time[rows], poses[rows], log.poses.source),
        commands=commands,
        columns=("v", "omega"),
        steered=True,
        geometry=geometry,
        notes=tuple(notes),
        where=lambda row: log.where(int(rows[row]) if row >= 0 else row),
    )


def _curvatures(
    kind: str, commands: Array, seen: tuple[Array, Array, Array], wheelbase: float | None
) -> tuple[Array, str, dict[str, float]]:
    """Curvatures (n,) of commands, words on the car, and its wheelbase where that is known."""
    told = commands[:, 1]
    if kind == CAR_OMEGA:
        return held_curvatures(commands), "", {}
    if kind == "curvature":
        return told, "", {}
    if kind == "servo":
        gain, middle = find_servo(*seen)
        how = f"; straight at servo {middle:.4g}, curvature {gain:.3g} 1/m for each 1 of it"
        return gain * (told - middle), how, {}
    if (largest := float(np.abs(seen[2]).max())) >= 0.5 * math.pi:
        raise DataError(
            f"steering: by up to {largest:.3g} rad no wheels are steered; --units steering=deg?"
        )
    base = wheelbase or find_wheelbase(*seen)
    how = f"; wheelbase {abs(base):.2f} m, it steers by at most {largest:.2f} rad"
    return np.tan(told) / base, how, {"wheelbase": base}


def find_wheelbase(time: Array, poses: Array, angles: Array) -> float:
    """Wheelbase [m] by which steering angles (n,) [rad] explain how poses (n, 3) turn.

    Angles that steer to the other side give a wheelbase below zero.

    Raises DataError if the log turns too little to tell, or turns otherwise than it is steered.
    """
    _, turned, ways = _pieces(time, poses, np.tan(angles))
    explained = (ways @ turned) ** 2 / np.maximum((ways**2).sum(axis=1), 1e-12)
    bent = ways[int(explained.argmax())]
    _must_explain(turned, bent)
    return float(bent @ bent / (bent @ turned))


def find_servo(time: Array, poses: Array, positions: Array) -> tuple[float, float]:
    """Curvature [1/m] for each 1 of a servo's positions (n,), and the position that is straight.

    Raises DataError if the log turns too little to tell, or turns otherwise than it is steered.
    """
    driven, turned, ways = _pieces(time, poses, positions)
    best, least = np.zeros(2), np.inf
    explained = driven
    for bent in ways:
        both = np.column_stack([bent, driven])
        found = np.linalg.lstsq(both, turned, rcond=1e-9)[0]
        if (left := float(((both @ found - turned) ** 2).sum())) < least:
            best, least, explained = found, left, both @ found
    gain, offset = best.tolist()
    _must_explain(turned, explained if gain else driven)
    return gain, -offset / gain


def _must_explain(turned: Array, bent: Array) -> None:
    """Refuse steering that does not explain the turns (n,)."""
    both = float(bent @ turned)
    if np.abs(turned).sum() < LEAST_TURNED or not both:
        raise DataError("steering: the log turns too little to tell the wheelbase: drive circles")
    if both**2 < EXPLAINED * float(bent @ bent) * float(turned @ turned):
        raise DataError(
            "steering: the robot turns otherwise than it is steered: is it a car? The commands of "
            "others are v and omega (--columns omega=NAME)"
        )


def _pieces(time: Array, poses: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """Distance ahead (P,), turn, and slopes summed over distance (LAGS, P) of pieces of a log.

    A log whose turns come where the robot drives nothing is refused.
    """
    heading = np.unwrap(poses[:, 2])
    ahead, _ = rotate(np.diff(poses[:, 0]), np.diff(poses[:, 1]), -heading[:-1])
    steps = np.diff(time)
    held = (steps > 0.0) & (steps < PIECE)  # what is left out of a log is no drive
    number = np.floor((time[:-1] - time[0]) / PIECE).astype(int)
    count = int(number.max(initial=0)) + 1
    used = np.bincount(number, held * steps, count) > 0.5 * PIECE
    steered, now = np.empty((len(LAGS), len(steps))), np.full(len(LAGS), slopes[0])
    for k, share in enumerate(-np.expm1(-np.maximum(steps, 0.0)[:, None] / LAGS)):
        steered[:, k] = now = now + share * (slopes[k] - now)

    def summed(values: Array) -> Array:
        out: Array = np.bincount(number, np.where(held, values, 0.0), count)[used]
        return out

    driven, turned = summed(ahead), summed(np.diff(heading))
    size = np.abs(turned)
    stands = np.abs(driven) < STANDS * np.median(np.abs(driven)) if len(driven) else driven > 0
    if size[stands].sum() > ON_THE_SPOT * size.sum() > 0.0:
        raise DataError(
            "steering: the robot turns where it stands, as no car does: its commands are v and "
            "omega (--columns omega=NAME)"
        )
    return driven, turned, np.stack([summed(ahead * s) for s in steered])


def disobeyed(time: Array, poses: Array, speeds: Array) -> Array:
    """Which rows (n,) of a log lie in stretches whose commanded speeds (n,) nothing obeys.

    `time`, `poses`, `speeds`: (n,) [s], (n, 3), and (n,) commanded [m/s].
    """
    asked = np.abs(speeds)
    window = time[:, None] + np.array((-0.5, 0.5)) * WINDOW
    places = [np.interp(window, time, column) for column in poses[:, :2].T]
    driven = np.hypot(*(np.diff(place, axis=1)[:, 0] for place in places)) / WINDOW
    told = asked > COMMANDED * np.quantile(asked, 0.99)
    if told.any():
        ratio = float(np.quantile(driven[told] / asked[told], REACHED))
        asked = asked if UNITS[0] < ratio < UNITS[1] else ratio * asked
    out = np.zeros(len(time), dtype=bool)
    for share in SHARES:
        ignored = told & (driven < share * asked)
        edges = np.flatnonzero(np.diff(np.concatenate([[0], ignored.astype(int), [0]])))
        for first, last in edges.reshape(-1, 2):
            if time[last - 1] - time[first] >= LATEST + share * SLOWEST:
                out |= (time >= time[first] - EASES) & (time <= time[last - 1] + EASES)
    return out


def _relocated(time: Array, poses: Array, speeds: Array) -> Array:
    """Which rows (n,) lie beside a jump of the pose: farther than any command (n,) drives."""
    steps = np.maximum(np.diff(time), 1e-9)
    moved = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    largest = float(np.quantile(np.abs(speeds), 0.99))
    out = np.zeros(len(time), dtype=bool)
    for row in np.flatnonzero(moved > JUMP * largest * np.maximum(steps, 0.25 * WINDOW)):
        out |= (time >= time[row] - 0.5 * WINDOW) & (time <= time[row + 1] + 0.5 * WINDOW)
    return out
