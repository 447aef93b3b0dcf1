"""Streams of a log: thinned to bounded memory, chosen, and put together into poses and commands."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.formats.columns import CAR_OMEGA
from kmpc_lite.learn.logs import Log, Series, Topic
from kmpc_lite.types import Array

MOST_SAMPLES = 1_000_000  # samples that are kept of one stream: 40 MB of poses, 14 hours at 20 Hz
SHARES = (
    "commands are shares of full throttle and steering, not m/s and rad/s: the model is one of "
    "those shares, and drives a robot that is commanded by them"
)
SIDEWAYS = 0.05
"""Share of the largest speed ahead from which on a speed to the left is that of an omni."""
NEAR = 0.5  # positions farther from the next heading are left out [s]
EARTH = 6_378_137.0  # radius at the equator [m]


class Thinned:
    """Samples at least `spacing` apart; where they become too many, every other one is left out.

    `width`: values of a sample. `spacing`: least time between two samples that are kept [s].
    `most`: samples that are kept.
    """

    def __init__(self, width: int, spacing: float, most: int = MOST_SAMPLES) -> None:
        self._width, self._spacing, self._most = width, spacing, most
        self._rows = array("d")
        self._last: float | None = None

    def wants(self, time: float) -> bool:
        """Whether a sample at a time [s] is to be kept: one that runs back always is."""
        last = self._last
        return last is None or time < last or time - last >= self._spacing * (1.0 - 1e-6)

    def add(self, time: float, *values: float) -> None:
        """Keep a sample."""
        self._last = time
        self._rows.append(time)
        self._rows.extend(values)
        if len(self._rows) >= self._most * (1 + self._width):
            kept = self.rows()[::2]
            seconds = float(kept[-1, 0] - kept[0, 0])
            self._rows = array("d", np.ascontiguousarray(kept).tobytes())
            self._spacing = max(2.0 * self._spacing, seconds / self._most)

    def rows(self) -> Array:
        """Time and values, (n, 1 + width)."""
        return np.array(self._rows, dtype=float).reshape(-1, 1 + self._width)


def pick(path: Path, name: str, chosen: Mapping[str, str], there: Sequence[str], seen: str) -> str:
    """Choose a source: the user's, else the first that is there.

    Raises DataError if it is not.
    """
    wanted = chosen.get(name)
    if wanted is None and there:
        return there[0]
    if wanted in there:
        return str(wanted)
    what = "pose" if name == "odom" else "command"
    told = f"topics: {name}={wanted}: not logged" if wanted else f"no {what} is logged"
    raise DataError(f"{path}: {told}; here are {', '.join(there) or seen or 'no messages at all'}")


def make_log(
    path: Path,
    poses: tuple[str, Array],
    commands: Series,
    kind: str,
    counts: Mapping[str, int],
    shares: bool = False,
    car: bool = False,
) -> Log:
    """Put a log together from poses and commands of an autopilot.

    `path`: for messages. `poses`: where they were found; time, north, east and yaw from north, (n,
    4). `commands`: turns to the left positive. `kind`: of the messages. `counts`: messages of each
    name that are in the file. `shares`: whether the commands are shares of what the motors can do.
    `car`: whether it steers its wheels: shares of steering are positions of its servo then. Raises
    DataError for fewer than two poses.
    """
    source, rows = poses
    if len(rows) < 2:
        raise DataError(f"{path}: {source}: {len(rows)} pose(s) with a heading; expected 2 or more")
    time, north, east, yaw = rows.T
    seconds = float(np.ptp(time))
    rates = {name: n / seconds if seconds > 0.0 else None for name, n in counts.items()}
    notes = (f"poses: {source}; commands: {commands.source}", *((SHARES,) if shares else ()))
    return Log(
        str(path),
        Series(time, np.column_stack([east, north, wrap(0.5 * np.pi - yaw)]), source),
        commands,
        topics=tuple(Topic(name, kind, n, rates[name]) for name, n in sorted(counts.items())),
        notes=notes,
        columns=("v", ("servo" if shares else CAR_OMEGA) if car else "omega"),
        shares=shares,
    )


def two_or_three(log: Log) -> Log:
    """The same log, without a speed to the left that is next to nothing: it is no omni's then."""
    if "lateral" not in log.columns:
        return log
    v, lateral = np.abs(log.commands.values[:, :2]).max(axis=0)
    if lateral > SIDEWAYS * v:
        return replace(log, notes=(*log.notes, 'three speeds, an omni: wheels = {kind = "omni"}'))
    kept = replace(log.commands, values=log.commands.values[:, [0, 2]])
    less = ("speeds to the left are next to nothing: this is no omni",) if lateral > 0.0 else ()
    return replace(log, commands=kept, notes=(*log.notes, *less), columns=log.columns[::2])


def held_together(first: Array, second: Array) -> Array:
    """Rows (n, 3) of time and two values that are logged apart: each is held until its next one.

    `first`, `second`: time [s] and value, (k, 2) and (m, 2).
    """
    time = np.unique(np.concatenate([first[:, 0], second[:, 0]]))
    time = time[time >= max(first[0, 0], second[0, 0])]
    places = (np.searchsorted(rows[:, 0], time, side="right") - 1 for rows in (first, second))
    held = (rows[np.maximum(at, 0), 1] for rows, at in zip((first, second), places, strict=True))
    return np.column_stack([time, *held])


def with_heading(positions: Array, headings: Array) -> Array:
    """Rows (n, 4) of time, x, y and a heading that is interpolated from messages of its own.

    `positions`: time [s], x and y [m], (n, 3). `headings`: time [s] and heading [rad], (k, 2), two
    at least.
    """
    time, known = positions[:, 0], headings[:, 0]
    after = np.clip(np.searchsorted(known, time), 1, len(known) - 1)
    near = np.minimum(np.abs(known[after - 1] - time), np.abs(known[after] - time))
    turned = np.interp(time, known, np.unwrap(headings[:, 1]))
    kept: Array = np.column_stack([positions, turned])[near <= NEAR]
    return kept


def local_metres(latitude: Array, longitude: Array) -> Array:
    """Metres north and east of the first position, (n, 2), from degrees (n,)."""
    north = np.radians(latitude - latitude[0]) * EARTH
    east = np.radians(longitude - longitude[0]) * EARTH * np.cos(np.radians(latitude[0]))
    return np.column_stack([north, east])
