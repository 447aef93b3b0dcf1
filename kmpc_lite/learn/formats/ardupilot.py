"""ArduPilot's logs through pymavlink: .bin of its memory card, .tlog of a ground station.

Times are the vehicle's own, north, east and yaw become x east, y north; turns to the left are
positive.
"""

from __future__ import annotations

import struct
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from dataclasses import replace
from io import StringIO
from math import isfinite, radians
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.columns import short
from kmpc_lite.learn.formats.streams import (
    Thinned,
    held_together,
    local_metres,
    make_log,
    pick,
    with_heading,
)
from kmpc_lite.learn.logs import Log, ReadOptions, Series
from kmpc_lite.reading import open_regular
from kmpc_lite.types import Array

STEERING = 26  # SERVOn_FUNCTION of a servo that steers: ArduPilot's GroundSteering
TELLING = 5000  # messages between two looks at the progress


def steers(settings: Mapping[str, float]) -> bool:
    """Whether an ArduPilot's parameters, by name, are those of a car."""
    return any(
        name.startswith("SERVO") and name.endswith("_FUNCTION") and value == STEERING
        for name, value in settings.items()
    )


@contextmanager
def _quiet(path: Path) -> Iterator[None]:
    """Run pymavlink, which prints, and raises many kinds for bytes that are no messages."""
    with redirect_stdout(StringIO()), redirect_stderr(StringIO()):
        try:
            yield
        except (DataError, OSError, KeyboardInterrupt):
            raise
        except Exception as error:
            told = short(" ".join(str(error).split()) or type(error).__name__)
            raise DataError(f"{path}: not an ArduPilot log, or damaged: {told}") from error


def _poses(rows: Mapping[str, Array], name: str, attitude: str) -> Array:
    """Time, north, east and yaw (n, 4), of positions on the globe or in metres, and headings."""
    where = rows[name]
    if name in ("POS", "GLOBAL_POSITION_INT"):
        where = np.column_stack([where[:, 0], local_metres(where[:, 1], where[:, 2])])
    return where if where.shape[1] == 4 else with_heading(where, rows[attitude])


# the memory card's

HEAD = b"\xa3\x95"
FIELDS = {
    "XKF1": ("PN", "PE", "Yaw"),
    "NKF1": ("PN", "PE", "Yaw"),
    "POS": ("Lat", "Lng"),
    "ATT": ("Yaw",),
    "THR": ("DesSpeed", "ThrOut"),
    "STER": ("DesTurnRate", "SteerOut"),
}
"""What is read of which message; angles in degrees, turns to the right."""
FULL_STEERING = 4500.0  # SteerOut of a robot that turns as fast as it can


def read_dataflash(path: Path, options: ReadOptions) -> Log:
    """Read poses of the EKF, or of the GPS, and commands: wanted speeds, or shares of the motors.

    Raises DataError if one of them is not logged.
    """
    with open_regular(path) as file:
        if (begin := file.read(3))[:2] != HEAD:
            got = begin.hex() or "nothing"
            raise DataError(f"{path}: not an ArduPilot log: it begins with {got}")
    kept = {name: Thinned(len(fields), options.spacing) for name, fields in FIELDS.items()}
    cores, settings, counts = dict[str, Any](), dict[str, float](), Counter[str]()
    with _quiet(path):
        for n, message in enumerate(_messages(path)):
            name = message.get_type()
            counts[name] += 1
            if options.progress is not None and n % TELLING == 0:
                options.progress(message._parent.offset, message._parent.data_len)
            if name == "PARM" and isinstance(value := message.to_dict().get("Value"), float):
                settings[str(message.Name)] = value
            elif name in kept:
                _keep(message, kept[name], cores)
    rows = {name: samples.rows() for name, samples in kept.items()}
    rows = {name: samples for name, samples in rows.items() if len(samples) > 1}
    seen = ", ".join(sorted(counts)[:12])
    there = [n for n in FIELDS if n in rows and (n[1:] == "KF1" or (n == "POS" and "ATT" in rows))]
    name = pick(path, "odom", options.topics, there, seen)
    commands, shares = _commands(path, rows, options.topics, seen)
    poses = f"{name} (north, east, yaw)", _poses(rows, name, "ATT")
    return make_log(path, poses, commands, "DataFlash", counts, shares, steers(settings))


def _messages(path: Path) -> Iterator[Any]:
    """Yield a log's messages, passing over bytes that belong to none."""
    from pymavlink.DFReader import DFReader_binary

    class Stream(DFReader_binary):  # type: ignore[misc]
        """Without its index of all messages, which stops at such bytes, and grows with the log."""

        def init_arrays(self, progress_callback: Any = None) -> None:
            pass

        def init_clock(self) -> None:
            pass

        init_arrays_fast = init_arrays

    with Stream(str(path)) as log:
        while (message := log.recv_msg()) is not None:
            yield message


def _keep(message: Any, kept: Thinned, cores: dict[str, Any]) -> None:
    """Keep what is needed of a message; of several estimators the first's."""
    told, name = message.to_dict(), message.get_type()
    time = 1e-6 * told["TimeUS"] if "TimeUS" in told else 1e-3 * told.get("TimeMS", np.nan)
    values = [told.get(field, np.nan) for field in FIELDS[name]]
    numbers = all(isinstance(value, int | float) for value in (time, *values))
    if not (numbers and isfinite(time) and isfinite(values[0])):
        return
    if cores.setdefault(name, told.get("C")) == told.get("C") and kept.wants(time):
        if "Yaw" in told:
            values[-1] = radians(values[-1])
        kept.add(time, *values)


def _commands(
    path: Path, rows: Mapping[str, Array], chosen: Mapping[str, str], seen: str
) -> tuple[Series, bool]:
    """Commands, and whether they are shares of what motors can do."""
    there = []
    if "THR" in rows and "STER" in rows:
        moving = all(np.nan_to_num(rows[n][:, 1]).any() for n in ("THR", "STER"))
        there = ["desired", "output"] if moving else ["output"]
    desired = pick(path, "cmd", chosen, there, f"{seen}; THR and STER hold commands") == "desired"
    field = [0, 1 if desired else 2]
    time, ahead, turn = held_together(rows["THR"][:, field], rows["STER"][:, field]).T
    if desired:
        values = np.column_stack([ahead, -np.radians(turn)])
        return Series(time, values, "THR.DesSpeed, STER.DesTurnRate"), False
    full = FULL_STEERING if np.abs(turn).max() > 1.5 else 1.0
    values = np.column_stack([ahead / 100.0, -turn / full])
    return Series(time, values, "THR.ThrOut, STER.SteerOut"), True


# a ground station's

BLOCK, STAMP = 1 << 20, struct.Struct(">Q")
"""Bytes read at once; the stamp before each frame [us since 1970]."""
V1, V2, SIGNED, SIGNATURE = 0xFE, 0xFD, 1, 13
OVERHEAD = {V1: 8, V2: 12}  # bytes of a frame beside its payload
LATEST = 10_000_000_000_000_000  # microseconds since 1970 that no stamp exceeds: the year 2286
BODY_FRAMES = (8, 9, 12)  # MAV_FRAME_BODY_NED, _BODY_OFFSET_NED, _BODY_FRD: x along the nose
IGNORES = 8 | 2048  # bits of a set-point's type_mask that leave out its speed, or its turn
POSES = ("LOCAL_POSITION_NED", "GLOBAL_POSITION_INT")
COMMANDS = (
    "SET_POSITION_TARGET_LOCAL_NED",
    "MANUAL_CONTROL",
    "RC_CHANNELS_OVERRIDE",
    "RC_CHANNELS",
)
"""In the order in which they are preferred."""
TELEMETRY = (*POSES, "ATTITUDE")
SETTING = "PARAM_VALUE"
STEP = 0.5
"""A recorder's clock that goes on by so much more, or less, than the vehicle's has stepped [s]."""


def read_tlog(path: Path, options: ReadOptions) -> Log:
    """Read the vehicle's poses, and what it was told: set-points, or positions of sticks.

    Raises DataError if one of them is not in the log.
    """
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    decoder, clock = dialect.MAVLink(None), _VehicleClock()
    kept = {name: Thinned(1 if name == "ATTITUDE" else 2, options.spacing)
            for name in (*TELEMETRY, *COMMANDS)}  # fmt: skip
    names = {number: m.msgname for number, m in dialect.mavlink_map.items()}
    counts, settings, vehicle = Counter[str](), dict[str, float](), None
    for time, number, frame in frames(path):
        name = names.get(number, f"#{number}")
        counts[name] += 1
        if name not in kept and name != SETTING:
            continue
        try:
            message = decoder.decode(bytearray(frame))
        except Exception:  # pymavlink raises several kinds for a wrong check sum
            continue
        time = clock.corrected(time, message if name in TELEMETRY else None)
        if name == SETTING:
            settings[message.param_id] = message.param_value
            continue
        sender, target = message.get_srcSystem(), getattr(message, "target_system", 0)
        vehicle = sender if name in POSES and vehicle is None else vehicle
        own = name in (*TELEMETRY, "RC_CHANNELS")
        meant = getattr(message, "target", target)
        if sender != vehicle if own else vehicle is not None and meant not in (0, vehicle):
            continue
        values = _values(name, message)
        if values is not None and np.isfinite(values).all() and kept[name].wants(time):
            kept[name].add(time, *values)
    if not counts:
        raise DataError(f"{path}: no MAVLink frame in it: not a tlog, or empty")
    rows = {name: samples.rows() for name, samples in kept.items()}
    rows = {name: samples for name, samples in rows.items() if len(samples) > 1}
    seen, there = ", ".join(sorted(counts)[:12]), [n for n in POSES if {n, "ATTITUDE"} <= set(rows)]
    chosen = pick(path, "odom", options.topics, there, f"{seen} (ATTITUDE and a position needed)")
    told = f"{seen} ({', '.join(COMMANDS)} are read)"
    source = pick(path, "cmd", options.topics, [n for n in COMMANDS if n in rows], told)
    held = Series(rows[source][:, 0], rows[source][:, 1:], source)
    poses, shares = (f"{chosen}, ATTITUDE", _poses(rows, chosen, "ATTITUDE")), source != COMMANDS[0]
    log = make_log(path, poses, held, "MAVLink", counts, shares, steers(settings))
    return replace(log, notes=(*log.notes, *clock.notes))


def frames(path: Path) -> Iterator[tuple[float, int, bytes]]:
    """Yield time [s], message number and bytes of each frame, until `BLOCK` bytes hold none."""
    with open_regular(path) as file:
        data, at, passed = b"", 0, 0
        while passed <= BLOCK:
            if len(data) - at < STAMP.size + 280 + SIGNATURE:
                data, at = data[at:] + file.read(BLOCK), 0
            if len(data) - at < STAMP.size + 8:
                return
            start = at + STAMP.size
            magic, (stamp,) = data[start], STAMP.unpack_from(data, at)
            size = OVERHEAD.get(magic, 0)
            if not size or stamp > LATEST:
                at, passed = at + 1, passed + 1
                continue
            size += data[start + 1]
            if magic == V2 and data[start + 2] & SIGNED:
                size += SIGNATURE
            end = start + size
            number = data[start + 5]
            if magic == V2:
                number = int.from_bytes(data[start + 7 : start + 10], "little")
            if end > len(data):
                return
            yield stamp * 1e-6, number, data[start:end]
            at, passed = end, 0


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
            along_nose = m.coordinate_frame in BODY_FRAMES and not m.type_mask & IGNORES
            return (m.vx, -m.yaw_rate) if along_nose else None
        case "MANUAL_CONTROL":
            return m.x / 1000.0, -m.y / 1000.0
    sticks = [(pulse - 1500) / 500.0 if 800 <= pulse <= 2200 else 0.0  # [us]; others are not used
              for pulse in (m.chan3_raw, m.chan1_raw)]  # fmt: skip
    return sticks[0], -sticks[1]
