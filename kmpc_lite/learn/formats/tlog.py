"""MAVLink logs (.tlog) of MAVProxy, QGroundControl or the bridge, streamed."""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.streams import (
    Thinned,
    counted_topics,
    local_metres,
    make_log,
    pick,
    steers,
    with_heading,
)
from kmpc_lite.learn.logs import Log, ReadOptions, Series
from kmpc_lite.reading import open_regular
from kmpc_lite.types import Array

BLOCK = 1 << 20
"""Bytes read at once."""
STAMP = struct.Struct(">Q")
V1, V2, SIGNED = 0xFE, 0xFD, 1
OVERHEAD = {V1: 8, V2: 12}
"""Bytes of a frame beside its payload."""
SIGNATURE = 13
LATEST = 10_000_000_000_000_000
"""Microseconds since 1970 that no stamp exceeds: the year 2286."""
BODY_FRAMES = (8, 9, 12)
"""MAV_FRAME_BODY_NED, _BODY_OFFSET_NED, _BODY_FRD: x along the nose."""
IGNORES_SPEED, IGNORES_TURN = 8, 2048
"""Bits of a set-point's type_mask."""
WIDTHS = {
    "LOCAL_POSITION_NED": 2,
    "GLOBAL_POSITION_INT": 2,
    "ATTITUDE": 1,
    "SET_POSITION_TARGET_LOCAL_NED": 2,
    "MANUAL_CONTROL": 2,
    "RC_CHANNELS_OVERRIDE": 2,
    "RC_CHANNELS": 2,
}
"""Messages that are read, and how many values of each."""
SETTING = "PARAM_VALUE"
POSES = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
TELEMETRY = (*POSES, "ATTITUDE")
STEP = 0.5
"""A recorder's clock that goes on by so much more, or less, than the vehicle's has stepped [s]."""
COMMANDS = tuple(WIDTHS)[3:]
"""In the order in which they are preferred."""


def frames(file: BinaryIO) -> Iterator[tuple[float, int, bytes]]:
    """Yield time [s], message number and bytes of each frame; what is none is passed over."""
    data, at = b"", 0
    while True:
        if len(data) - at < STAMP.size + 280 + SIGNATURE:
            data, at = data[at:] + file.read(BLOCK), 0
        if len(data) - at < STAMP.size + 8:
            return
        start = at + STAMP.size
        magic, (stamp,) = data[start], STAMP.unpack_from(data, at)
        size = OVERHEAD.get(magic, 0)
        if not size or stamp > LATEST:
            at += 1
            continue
        size += data[start + 1]
        if magic == V2 and data[start + 2] & SIGNED:
            size += SIGNATURE
        frame = data[start : start + size]
        if len(frame) < size:
            return
        number = frame[5] if magic == V1 else int.from_bytes(frame[7:10], "little")
        yield 1e-6 * stamp, number, frame
        at = start + size


def read_tlog(path: Path, options: ReadOptions) -> Log:
    """Read poses of a vehicle and the set-points, or the sticks, that it was given.

    Raises
    ------
    DataError
        If one of them is not logged.
    """
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    clock = _VehicleClock()
    numbers = {getattr(dialect, f"MAVLINK_MSG_ID_{name}"): name for name in (*WIDTHS, SETTING)}
    decoder = dialect.MAVLink(None)
    decoder.robust_parsing = True
    kept = {name: Thinned(width, options.spacing) for name, width in WIDTHS.items()}
    counts: dict[int, int] = {}
    settings: dict[str, float] = {}
    vehicle: int | None = None
    with open_regular(path) as file:
        for time, number, frame in frames(file):
            counts[number] = counts.get(number, 0) + 1
            if number not in numbers:
                continue
            message = _decoded(decoder, frame)
            name = numbers[number]
            if message is None or message.get_type() != name:
                continue
            time = clock.corrected(time, message if name in TELEMETRY else None)
            if name == SETTING:
                settings[message.param_id] = message.param_value
                continue
            sender = message.get_srcSystem()
            if name in POSES and vehicle is None:
                vehicle = sender
            told = name in ("ATTITUDE", "RC_CHANNELS", *POSES)
            if (told and sender != vehicle) or _is_for_another(message, vehicle):
                continue
            values = _values(name, message)
            if values is not None and np.isfinite(values).all() and kept[name].wants(time):
                kept[name].add(time, *values)
    if not counts:
        raise DataError(f"{path}: no MAVLink frame in it: not a tlog, or empty")
    rows, seen = {n: k.rows() for n, k in kept.items()}, _names(dialect, counts)
    log = _log(path, options, rows, seen, steers(settings))
    return replace(log, notes=(*log.notes, *clock.notes))


class _VehicleClock:
    """Takes the vehicle's own clock where that of the recorder steps."""

    def __init__(self) -> None:
        self._last: tuple[float, float] | None = None
        """Corrected time and the vehicle's, of its last message [s]."""
        self._shift, self._steps = 0.0, 0

    def corrected(self, time: float, message: Any) -> float:
        """Time of a message [s]; only the vehicle's own tell how far the recorder is off."""
        time, last = time + self._shift, self._last
        if message is None:  # it lies near the vehicle's last one, whatever the recorder says
            return time if last is None else min(max(time, last[0]), last[0] + STEP)
        booted = 1e-3 * message.time_boot_ms
        if last is not None and booted >= last[1]:
            off = last[0] + booted - last[1] - time
            if abs(off) > STEP:
                self._shift, time, self._steps = self._shift + off, time + off, self._steps + 1
        self._last = (time, booted)
        return time

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know."""
        told = f"the recorder's clock stepped {self._steps} time(s): the vehicle's own counts"
        return (told,) if self._steps else ()


def _is_for_another(message: Any, vehicle: int | None) -> bool:
    """Whether a message is addressed to another vehicle."""
    target = getattr(message, "target_system", getattr(message, "target", 0))
    return vehicle is not None and target not in (0, vehicle)


def _decoded(decoder: Any, frame: bytes) -> Any:
    """A message, or None if its check sum fails."""
    try:
        return decoder.decode(bytearray(frame))
    except Exception:  # pymavlink raises several kinds for bytes that are no message
        return None


def _names(dialect: Any, counts: Mapping[int, int]) -> dict[str, int]:
    """Counts by the messages' names."""
    known = dialect.mavlink_map
    return {
        known[number].msgname if number in known else f"#{number}": count
        for number, count in sorted(counts.items())
    }


def _values(name: str, m: Any) -> tuple[float, ...] | None:
    """What is kept of a message; turns to the left positive."""
    match name:
        case "LOCAL_POSITION_NED":
            return m.x, m.y
        case "GLOBAL_POSITION_INT":
            return 1e-7 * m.lat, 1e-7 * m.lon
        case "ATTITUDE":
            return (m.yaw,)
        case "SET_POSITION_TARGET_LOCAL_NED":
            ignored = m.type_mask & (IGNORES_SPEED | IGNORES_TURN)
            along_nose = m.coordinate_frame in BODY_FRAMES
            return (m.vx, -m.yaw_rate) if along_nose and not ignored else None
        case "MANUAL_CONTROL":
            return m.x / 1000.0, -m.y / 1000.0
        case _:
            return _stick(m.chan3_raw), -_stick(m.chan1_raw)


def _stick(pulse: int) -> float:
    """Share of a stick's way, of a pulse [us]; 0 if it is not used."""
    return (pulse - 1500) / 500.0 if 800 <= pulse <= 2200 else 0.0


def _log(
    path: Path,
    options: ReadOptions,
    rows: Mapping[str, Array],
    counts: Mapping[str, int],
    car: bool,
) -> Log:
    """Poses and commands of what is there."""
    seen = ", ".join(list(counts)[:12])
    turned = len(rows["ATTITUDE"]) > 1
    poses = [n for n in POSES if len(rows[n]) > 1 and turned]
    chosen = pick(path, "odom", options.topics, poses, f"{seen} (ATTITUDE and a position needed)")
    commands = [n for n in COMMANDS if len(rows[n]) > 1]
    source = pick(path, "cmd", options.topics, commands, f"{seen} ({', '.join(COMMANDS)} are read)")
    where = rows[chosen]
    if chosen == "GLOBAL_POSITION_INT":
        where = np.column_stack([where[:, 0], local_metres(where[:, 1], where[:, 2])])
    found = with_heading(where, rows["ATTITUDE"])
    held = Series(rows[source][:, 0], rows[source][:, 1:], source)
    topics = counted_topics("MAVLink", counts, found[:, 0])
    shares = source != COMMANDS[0]
    return make_log(path, found, f"{chosen}, ATTITUDE", held, shares, topics, car)
