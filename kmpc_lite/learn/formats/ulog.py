"""PX4's .ulg logs, through pyulog: only the topics that are needed are kept."""

from __future__ import annotations

import io
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.columns import short
from kmpc_lite.learn.formats.streams import held_together, make_log, pick, with_heading
from kmpc_lite.learn.logs import Log, ReadOptions, Series
from kmpc_lite.reading import open_regular
from kmpc_lite.types import Array

POSITION = "vehicle_local_position"
SPEEDS = (
    ("rover_speed_setpoint.speed_body_x", "rover_rate_setpoint.yaw_rate_setpoint"),
    ("rover_velocity_status.speed_body_x_setpoint", "rover_rate_setpoint.yaw_rate_setpoint"),
    ("rover_velocity_setpoint.speed", "rover_rate_setpoint.yaw_rate_setpoint"),
    ("rover_differential_setpoint.forward_speed_setpoint",)
    + ("rover_differential_setpoint.yaw_rate_setpoint",),
    ("differential_drive_setpoint.speed", "differential_drive_setpoint.yaw_rate"),
)
SHARES = (
    ("rover_throttle_setpoint.throttle_body_x",)
    + ("rover_steering_setpoint.normalized_steering_setpoint",),
    ("rover_throttle_setpoint.throttle_body_x", "rover_steering_setpoint.normalized_speed_diff"),
    ("vehicle_thrust_setpoint.xyz[0]", "vehicle_torque_setpoint.xyz[2]"),
    ("actuator_controls_0.control[3]", "actuator_controls_0.control[2]"),
    ("manual_control_setpoint.throttle", "manual_control_setpoint.roll"),
)
"""Topic and field of the forward command, then of the turn, in the order in which they are
preferred; turns to the right are positive there."""


def read_ulog(path: Path, options: ReadOptions) -> Log:
    """Read the local position, and what speeds or shares of the motors the rover was to have.

    Raises DataError if one of them is not logged.
    """
    from pyulog import ULog

    wanted = {name.split(".")[0] for pair in (*SPEEDS, *SHARES) for name in pair}
    with open_regular(path) as file, redirect_stdout(io.StringIO()):
        try:
            log = ULog(_Bounded(file), [POSITION, *sorted(wanted)])
        except Exception as error:  # pyulog raises many kinds
            told = short(" ".join(str(error).split()) or type(error).__name__)
            raise DataError(f"{path}: not a PX4 log, or damaged: {told}") from error
    read = [topic for topic in log.data_list if "timestamp" in topic.data and not topic.multi_id]
    counts, rows = {topic.name: len(topic.data["timestamp"]) for topic in read}, _rows_of(read)
    seen = ", ".join(sorted(log.message_formats)[:8])
    said = f"messages such as {seen}" if seen else ""
    pick(path, "odom", options.topics, [POSITION], said)
    x, y = (rows.get(f"{POSITION}.{name}") for name in "xy")
    turned = rows.get(f"{POSITION}.heading", rows.get(f"{POSITION}.yaw"))
    if x is None or y is None or turned is None:
        raise DataError(
            f"{path}: no pose is logged: {POSITION} with x, y and heading expected, "
            f"got {said or 'nothing'}"
        )
    there = {f[0].split(".")[0]: f for f in reversed((*SPEEDS, *SHARES)) if set(f) <= rows.keys()}
    order = [name for f in (*SPEEDS, *SHARES) if there.get(name := f[0].split(".")[0]) == f]
    chosen = there[pick(path, "cmd", options.topics, order, said)]
    time, ahead, turn = held_together(*(rows[name] for name in chosen)).T
    commands = Series(time, np.column_stack([ahead, -turn]), ", ".join(chosen))
    poses = f"{POSITION} (north, east, heading)", with_heading(held_together(x, y), turned)
    return make_log(path, poses, commands, "ULog", counts, chosen in SHARES)


class _Bounded:
    """A file that may be read only so often: pyulog reads the end of some damaged logs for ever."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        # two reads a message, and at most one message a byte where it looks for the next whole one
        self._left = 2 * file.seek(0, io.SEEK_END) + 1000
        file.seek(0)
        self.seek, self.tell, self.close = file.seek, file.tell, file.close

    def read(self, size: int = -1) -> bytes:
        self._left -= 1
        if self._left < 0:
            raise OSError("it has no end")
        return self._file.read(size)


def _rows_of(topics: list[Any]) -> dict[str, Array]:
    """Time [s] and one value, (n, 2), by topic and field."""
    found: dict[str, Array] = {}
    for topic in topics:
        time = 1e-6 * topic.data["timestamp"].astype(float)
        for field, values in topic.data.items():
            rows = np.column_stack([time, values.astype(float)])
            rows = rows[np.isfinite(rows).all(axis=1)]
            if len(rows) > 1:
                found[f"{topic.name}.{field}"] = rows
    return found
