"""Streams of a log: thinned to bounded memory, and put together into rows of one table."""

from __future__ import annotations

from array import array
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.formats.columns import CAR_OMEGA
from kmpc_lite.learn.logs import Log, Series, Topic
from kmpc_lite.types import Array

MOST_SAMPLES = 1_000_000
"""Samples that are kept of one stream: 40 MB of poses, 14 hours at 20 Hz."""


class Thinned:
    """Samples at least `spacing` apart; where they become too many, every other one is left out.

    Parameters
    ----------
    width : int
        Values of a sample.
    spacing : float
        Least time between two samples that are kept [s].
    most : int
        Samples that are kept.
    """

    def __init__(self, width: int, spacing: float, most: int = MOST_SAMPLES) -> None:
        self._width, self._spacing, self._most = width, spacing, most
        self._rows = array("d")
        self._last: float | None = None
        self.seen = 0
        """Number of samples that have come."""

    def wants(self, time: float) -> bool:
        """Count a sample at a time [s]; whether it is to be kept: one that runs back always is."""
        self.seen += 1
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


SHARES = (
    "commands are shares of full throttle and steering, not m/s and rad/s: the model is one of "
    "those shares, and drives a robot that is commanded by them"
)


STEERING = 26
"""SERVOn_FUNCTION of a servo that steers: ArduPilot's GroundSteering."""


def steers(settings: Mapping[str, float]) -> bool:
    """Whether an ArduPilot's parameters, by name, are those of a car."""
    return any(
        name.startswith("SERVO") and name.endswith("_FUNCTION") and value == STEERING
        for name, value in settings.items()
    )


def pick(path: Path, name: str, chosen: Mapping[str, str], there: list[str], seen: str) -> str:
    """Choose a source: the user's, else the first that is there.

    Raises
    ------
    DataError
        If it is not.
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
    poses: Array,
    pose_source: str,
    commands: Series,
    shares: bool,
    topics: list[Topic],
    car: bool = False,
) -> Log:
    """Put a log together from poses and commands of an autopilot.

    Parameters
    ----------
    path : Path
        For messages.
    poses : ndarray
        Time, north, east and yaw from north, (n, 4).
    pose_source : str
        Where they were found.
    commands : Series
        Turns to the left positive.
    shares : bool
        Whether the commands are shares of what the motors can do.
    topics : list of Topic
        All that is in the file.
    car : bool
        Whether it steers its wheels: shares of steering are positions of its servo then.

    Raises
    ------
    DataError
        For fewer than two poses.
    """
    if len(poses) < 2:
        raise DataError(
            f"{path}: {pose_source}: {len(poses)} pose(s) with a heading; expected at least 2"
        )
    series = Series(poses[:, 0], enu(poses), pose_source)
    notes = (f"poses: {pose_source}; commands: {commands.source}", *((SHARES,) if shares else ()))
    columns = ("v", ("servo" if shares else CAR_OMEGA) if car else "omega")
    log = Log(str(path), series, commands, topics=tuple(topics), notes=notes)
    return replace(log, shares=shares, columns=columns)


def counted_topics(kind: str, counts: Mapping[str, int], time: Array) -> list[Topic]:
    """Messages by their names, with rates over the span of times (n,) [s]."""
    seconds = float(np.ptp(time)) if len(time) else 0.0
    return [
        Topic(name, kind, count, count / seconds if seconds > 0.0 else None)
        for name, count in counts.items()
    ]


NEAR = 0.5
"""Positions farther from the next heading are left out [s]."""
EARTH = 6_378_137.0
"""Radius at the equator [m]."""


def held_together(first: Array, second: Array) -> Array:
    """Rows (n, 3) of time and two values that are logged apart: each is held until its next one.

    Parameters
    ----------
    first, second : ndarray
        Time [s] and value, (k, 2) and (m, 2).
    """
    time = np.unique(np.concatenate([first[:, 0], second[:, 0]]))
    time = time[time >= max(first[0, 0], second[0, 0])]
    columns = [_held(time, rows) for rows in (first, second)]
    return np.column_stack([time, *columns])


def _held(time: Array, rows: Array) -> Array:
    """Last value at each time (n,)."""
    places = np.searchsorted(rows[:, 0], time, side="right") - 1
    values: Array = rows[np.clip(places, 0, len(rows) - 1), 1]
    return values


def with_heading(positions: Array, headings: Array) -> Array:
    """Rows (n, 4) of time, x, y and a heading that is interpolated from messages of its own.

    Parameters
    ----------
    positions : ndarray
        Time [s], x and y [m], (n, 3).
    headings : ndarray
        Time [s] and heading [rad], (k, 2), two at least.
    """
    time = positions[:, 0]
    known = headings[:, 0]
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


def enu(rows: Array) -> Array:
    """Poses (n, 3) with x east from rows (n, 4) of time, north, east and yaw from north."""
    return np.column_stack([rows[:, 2], rows[:, 1], wrap(0.5 * np.pi - rows[:, 3])])


SAME_CLOCK = 1.0
"""Stamps that differ by more than this from the time of recording come from another clock [s]."""


def stamps_of(rows: Array) -> Array:
    """Times of samples (n,) [s]."""
    recorded, stamps = rows[:, 0], rows[:, 1]
    if np.abs(stamps - recorded).max() < SAME_CLOCK and (np.diff(stamps) > 0.0).all():
        return stamps
    return recorded
