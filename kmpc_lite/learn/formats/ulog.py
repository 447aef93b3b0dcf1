"""PX4's .ulg logs, through pyulog: only the topics that are needed are kept."""

from __future__ import annotations

import contextlib
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.columns import short
from kmpc_lite.learn.formats.streams import (
    counted_topics,
    held_together,
    make_log,
    pick,
    with_heading,
)
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic
from kmpc_lite.reading import open_regular
from kmpc_lite.types import Array

POSITION, ATTITUDE = "vehicle_local_position", "vehicle_attitude"
SPEEDS = (
    ("rover_speed_setpoint", "speed_body_x", "rover_rate_setpoint", "yaw_rate_setpoint"),
    ("rover_velocity_status", "speed_body_x_setpoint", "rover_rate_setpoint", "yaw_rate_setpoint"),
    ("rover_velocity_setpoint", "speed", "rover_rate_setpoint", "yaw_rate_setpoint"),
    ("rover_differential_setpoint", "forward_speed_setpoint", "", "yaw_rate_setpoint"),
    ("differential_drive_setpoint", "speed", "", "yaw_rate"),
)
SHARED = (
    ("rover_throttle_setpoint", "throttle_body_x")
    + ("rover_steering_setpoint", "normalized_steering_setpoint"),
    ("rover_throttle_setpoint", "throttle_body_x")
    + ("rover_steering_setpoint", "normalized_speed_diff"),
    ("vehicle_thrust_setpoint", "xyz[0]", "vehicle_torque_setpoint", "xyz[2]"),
    ("actuator_controls_0", "control[3]", "", "control[2]"),
    ("manual_control_setpoint", "throttle", "", "roll"),
)
"""Topic and field of the forward command, then of the turn (no topic: the same), in the order in
which they are preferred; turns to the right are positive there."""


def read_ulog(path: Path, options: ReadOptions) -> Log:
    """Read the local position, and what speeds or shares of the motors the rover was to have.

    Raises
    ------
    DataError
        If one of them is not logged.
    """
    names = {POSITION, ATTITUDE, *(t for row in (*SPEEDS, *SHARED) for t in row[::2] if t)}
    data, said = _load(path, sorted(names))
    rows = _rows_of(data)
    pick(path, "odom", options.topics, [POSITION], said)
    poses = _poses(path, rows, said)
    there = {
        row[0]: row
        for row in reversed((*SPEEDS, *SHARED))
        if (row[0], row[1]) in rows and (row[2] or row[0], row[3]) in rows
    }
    order = [row[0] for row in (*SPEEDS, *SHARED) if there.get(row[0]) == row]
    name = pick(path, "cmd", options.topics, order, said)
    row = there[name]
    both = held_together(rows[row[0], row[1]], rows[row[2] or row[0], row[3]])
    source = ", ".join(f"{t}.{f}" for t, f in ((row[0], row[1]), (row[2] or row[0], row[3])))
    commands = Series(both[:, 0], both[:, 1:] * [1.0, -1.0], source)
    where = f"{POSITION} (north, east, heading)"
    return make_log(path, poses, where, commands, row in SHARED, _topics(data))


def _load(path: Path, names: list[str]) -> tuple[list[Any], str]:
    """Topics of a file, and the names of what was logged; pyulog prints, and raises many kinds."""
    from pyulog import ULog

    with open_regular(path) as file, contextlib.redirect_stdout(io.StringIO()):
        try:
            log = ULog(_Bounded(file), names)
        except Exception as error:
            told = short(" ".join(str(error).split()) or type(error).__name__)
            raise DataError(f"{path}: not a PX4 log, or damaged: {told}") from error
    seen = ", ".join(sorted(log.message_formats)[:8])
    timed = [topic for topic in log.data_list if "timestamp" in topic.data]
    return timed, f"messages such as {seen}" if seen else ""


class _Bounded:
    """A file that may be read only so often: pyulog reads the end of some damaged logs for ever."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        # two reads a message, and at most one message a byte where it looks for the next whole one
        self._left = 2 * file.seek(0, io.SEEK_END) + 1000
        file.seek(0)

    def read(self, size: int = -1) -> bytes:
        self._left -= 1
        if self._left < 0:
            raise OSError("it has no end")
        return self._file.read(size)

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        return self._file.seek(offset, whence)

    def tell(self) -> int:
        return self._file.tell()

    def close(self) -> None:
        self._file.close()


def _rows_of(data: list[Any]) -> dict[tuple[str, str], Array]:
    """Time [s] and one value, (n, 2), by topic and field, of the first instance of each."""
    found: dict[tuple[str, str], Array] = {}
    for topic in data:
        if topic.multi_id or len(topic.data["timestamp"]) < 2:
            continue
        time = 1e-6 * topic.data["timestamp"].astype(float)
        for field, values in topic.data.items():
            rows = np.column_stack([time, values.astype(float)])
            rows = rows[np.isfinite(rows).all(axis=1)]
            if len(rows) > 1:
                found[topic.name, field] = rows
    return found


def _poses(path: Path, rows: Mapping[tuple[str, str], Array], said: str) -> Array:
    """Time, north, east and heading of poses, (n, 4)."""
    parts = [rows.get((POSITION, field)) for field in ("x", "y")]
    turned = rows.get((POSITION, "heading"), rows.get((POSITION, "yaw")))
    if turned is None and (ATTITUDE, "q[0]") in rows:
        w, x, y, z = (rows[ATTITUDE, f"q[{k}]"][:, 1] for k in range(4))
        yaw = np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y**2 + z**2))
        turned = np.column_stack([rows[ATTITUDE, "q[0]"][:, 0], yaw])
    if parts[0] is None or parts[1] is None or turned is None:
        raise DataError(
            f"{path}: no pose is logged: {POSITION} with x, y and heading expected, "
            f"got {said or 'nothing'}"
        )
    return with_heading(held_together(parts[0], parts[1]), turned)


def _topics(data: list[Any]) -> list[Topic]:
    """Topics that were read, with rates."""
    return sorted(
        topic
        for read in data
        for topic in counted_topics(
            "ULog", {read.name: len(read.data["timestamp"])}, 1e-6 * read.data["timestamp"]
        )
    )
