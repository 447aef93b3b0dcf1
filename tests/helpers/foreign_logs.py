"""Logs as other people's tools write them, of one drive."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.learn.formats.rosbag import ACKERMANN, ACKERMANN_STAMPED, FIELDS, TWIST


class Drive(NamedTuple):
    """What a robot did: poses and commands at times of their own."""

    time: np.ndarray  # of the poses [s]
    poses: np.ndarray  # x, y, theta, (n, 3) [m, rad]; theta grows beyond half a turn
    command_time: np.ndarray
    commands: np.ndarray  # v, omega, (m, 2) [m/s, rad/s]; of an omni also its speed to the left


def drive(
    seconds: float = 60.0,
    rate: float = 50.0,
    seed: int = 0,
    start: float = 1000.0,
    hold: float = 1.0,
    delay: float = 0.0,
    gains: tuple[float, float] = (1.0, 1.0),
    speeds: tuple[float, float] = (0.8, 1.2),
    noise: tuple[float, float] = (0.0, 0.0),
    one_way: bool = False,
    lag: float = 0.0,
) -> Drive:
    """Drive at random: commands are held, repeated at 10 Hz, and obeyed `delay` later."""
    random = np.random.default_rng(seed)
    command_time = start + np.arange(0.0, seconds, 0.1)
    drawn = random.uniform(-1.0, 1.0, (int(seconds / hold) + 1, 2)) * speeds
    if one_way:
        drawn[:, 0] = np.abs(drawn[:, 0])
    commands = drawn[((command_time - start + 1e-9) / hold).astype(int)]
    fine = start + np.arange(0.0, seconds, 0.005)
    places = np.searchsorted(command_time, fine - delay + 1e-9, side="right") - 1
    acting = np.where(places[:, None] >= 0, commands[np.maximum(places, 0)], 0.0) * gains
    if lag > 0.0:
        for k in range(1, len(acting)):
            acting[k] = acting[k - 1] + (acting[k] - acting[k - 1]) * 0.005 / (lag + 0.005)
    theta = np.concatenate([[0.3], 0.3 + np.cumsum(acting[:-1, 1]) * 0.005])
    middle = theta + 0.5 * acting[:, 1] * 0.005
    steps = acting[:, 0] * 0.005
    x = np.concatenate([[0.0], np.cumsum(steps * np.cos(middle))[:-1]])
    y = np.concatenate([[0.0], np.cumsum(steps * np.sin(middle))[:-1]])
    every = max(1, round(200.0 / rate))
    poses = np.column_stack([x, y, theta])[::every]
    poses = poses + random.normal(size=poses.shape) * [noise[0], noise[0], noise[1]]
    return Drive(fine[::every], poses, command_time, commands)


def write_bag(path: Path, d: Drive, kind: str = "sqlite3", **how: Any) -> Path:
    """A bag of `kind` sqlite3, mcap or ros1, with odometry and cmd_vel and some other topic.

    `how`: ``pose``: odom, pose or tf. ``commands``: Twist, TwistStamped, or a car's
    AckermannDriveStamped of v and its angle. ``odoms``, ``cmds``: names of topics. ``clock``: what
    is added to the headers' stamps [s].
    """
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    first = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_JAZZY)
    for name in FIELDS.keys() - store.types.keys():
        store.register(get_types_from_msg(FIELDS[name], name))
    plugins = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
    made = Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugins[kind])
    make = _Messages(store.types, first, how.get("clock", 0.0))
    pose = how.get("pose", "odom")
    kinds = {
        "odom": ("nav_msgs/msg/Odometry", make.odometry),
        "pose": ("geometry_msgs/msg/PoseStamped", make.pose_stamped),
        "tf": ("tf2_msgs/msg/TFMessage", make.transform),
    }
    pose_kind, pose_message = kinds[pose]
    command_kind = how.get("commands", TWIST)
    with made as writer:
        odoms = [
            writer.add_connection(name, pose_kind, typestore=store)
            for name in how.get("odoms", ["/tf" if pose == "tf" else "/odom"])
        ]
        cmds = [
            writer.add_connection(name, command_kind, typestore=store)
            for name in how.get("cmds", ["/cmd_vel"])
        ]
        note = writer.add_connection("/note", "std_msgs/msg/String", typestore=store)
        events: list[tuple[float, Any, Any]] = [
            *((t, "pose", p) for t, p in zip(d.time, d.poses, strict=True)),
            *((t, "cmd", c) for t, c in zip(d.command_time, d.commands, strict=True)),
            (float(d.time[0]), "note", None),
        ]
        to_bytes = store.serialize_ros1 if first else store.serialize_cdr
        for t, what, values in sorted(events, key=lambda event: event[0]):
            nanoseconds = round(t * 1e9)
            if what == "note":
                message, where, kind_of = make.note(), [note], "std_msgs/msg/String"
            elif what == "pose":
                message, where, kind_of = pose_message(t, values), odoms, pose_kind
            else:
                message, where, kind_of = make.command(t, values, command_kind), cmds, command_kind
            for connection in where:
                writer.write(connection, nanoseconds, to_bytes(message, kind_of))
    return path


class _Messages:
    """Makes messages of rosbags' types."""

    def __init__(self, types: Any, first: bool, clock: float) -> None:
        self.types, self.first, self.clock = types, first, clock

    def make(self, name: str, *values: Any) -> Any:
        return self.types[name](*values)

    def header(self, t: float, frame: str = "odom") -> Any:
        nanoseconds = round((t + self.clock) * 1e9)
        stamp = self.make("builtin_interfaces/msg/Time", nanoseconds // 10**9, nanoseconds % 10**9)
        return self.make("std_msgs/msg/Header", *((0,) if self.first else ()), stamp, frame)

    def quaternion(self, theta: float) -> Any:
        half = 0.5 * theta
        return self.make("geometry_msgs/msg/Quaternion", 0.0, 0.0, np.sin(half), np.cos(half))

    def pose(self, p: np.ndarray) -> Any:
        point = self.make("geometry_msgs/msg/Point", float(p[0]), float(p[1]), 0.0)
        return self.make("geometry_msgs/msg/Pose", point, self.quaternion(p[2]))

    def bare_twist(self, v: float, omega: float, vy: float = 0.0) -> Any:
        linear = self.make("geometry_msgs/msg/Vector3", v, vy, 0.0)
        angular = self.make("geometry_msgs/msg/Vector3", 0.0, 0.0, omega)
        return self.make("geometry_msgs/msg/Twist", linear, angular)

    def odometry(self, t: float, p: np.ndarray) -> Any:
        pose = self.make("geometry_msgs/msg/PoseWithCovariance", self.pose(p), np.zeros(36))
        twist = self.make(
            "geometry_msgs/msg/TwistWithCovariance", self.bare_twist(0.1, 0.1), np.zeros(36)
        )
        return self.make("nav_msgs/msg/Odometry", self.header(t), "base_link", pose, twist)

    def pose_stamped(self, t: float, p: np.ndarray) -> Any:
        return self.make("geometry_msgs/msg/PoseStamped", self.header(t), self.pose(p))

    def transform(self, t: float, p: np.ndarray) -> Any:
        move = self.make("geometry_msgs/msg/Vector3", float(p[0]), float(p[1]), 0.0)
        both = self.make("geometry_msgs/msg/Transform", move, self.quaternion(p[2]))
        wheel = self.make("geometry_msgs/msg/Transform", move, self.quaternion(0.0))
        kind = "geometry_msgs/msg/TransformStamped"
        transforms = [
            self.make(kind, self.header(t, "base_link"), "wheel", wheel),
            self.make(kind, self.header(t), "base_link", both),
        ]
        return self.make("tf2_msgs/msg/TFMessage", transforms)

    def command(self, t: float, c: np.ndarray, kind: str = TWIST) -> Any:
        if kind == ACKERMANN_STAMPED:
            drive = self.make(ACKERMANN, float(c[1]), 0.0, float(c[0]), 0.0, 0.0)
            return self.make(kind, self.header(t), drive)
        bare = self.bare_twist(*map(float, c))
        return bare if kind == TWIST else self.make(kind, self.header(t, ""), bare)

    def note(self) -> Any:
        return self.make("std_msgs/msg/String", "hello")


def write_csv(path: Path, d: Drive, names: str = "t,x,y,theta,v,omega", **how: Any) -> Path:
    """A table with both at the times of the poses; ``scale`` multiplies the columns by name."""
    columns = dict(zip(("t", "x", "y", "theta", "v", "omega"), rows(d).T, strict=True))
    for name, size in how.get("scale", {}).items():
        columns[name] = columns[name] * size
    delimiter = how.get("delimiter", ",")
    table = np.column_stack(list(columns.values()))
    text = "\n".join(delimiter.join(f"{v:.9g}" for v in row) for row in table)
    path.write_text(f"{names.replace(',', delimiter)}\n{text}\n")
    return path


def rows(d: Drive) -> np.ndarray:
    """Table (n, 6) of t, x, y, theta within half a turn, v, omega; t from 0."""
    places = np.searchsorted(d.command_time, d.time + 1e-9, side="right") - 1
    theta = np.remainder(d.poses[:, 2] + np.pi, 2 * np.pi) - np.pi
    return np.column_stack(
        [d.time - d.time[0], d.poses[:, :2], theta, d.commands[np.maximum(places, 0)]]
    )


def write_tum(path: Path, d: Drive) -> Path:
    """A TUM trajectory; the commands are written beside it as NAME.commands.csv."""
    half = 0.5 * d.poses[:, 2]
    zero = np.zeros(len(half))
    table = np.column_stack([d.time, d.poses[:, :2], zero, zero, zero, np.sin(half), np.cos(half)])
    np.savetxt(path, table, fmt="%.9f", header="timestamp tx ty tz qx qy qz qw")
    _write_commands(path.with_suffix(".commands.csv"), d, "stamp,cmd_v,cmd_w", 1.0)
    return path


def write_euroc(path: Path, d: Drive) -> Path:
    """An EuRoC ground truth; the commands beside it, in ns too."""
    head = [
        "#timestamp [ns]",
        *(f"p_RS_R_{a} [m]" for a in "xyz"),
        *(f"q_RS_{a} []" for a in "wxyz"),
    ]
    half = 0.5 * d.poses[:, 2]
    lines = [
        f"{round(t * 1e9)},{x:.9f},{y:.9f},0,{np.cos(h):.9f},0,0,{np.sin(h):.9f}"
        for t, (x, y, _), h in zip(d.time, d.poses, half, strict=True)
    ]
    path.write_text("\n".join([",".join(head), *lines, ""]))
    _write_commands(path.with_suffix(".commands.csv"), d, "t [ns],v [m/s],omega [rad/s]", 1e9)
    return path


def _write_commands(path: Path, d: Drive, names: str, scale: float) -> None:
    table = zip(d.command_time * scale, d.commands, strict=True)
    lines = [f"{t:.9f},{v:.6f},{w:.6f}" for t, (v, w) in table]
    path.write_text("\n".join([names, *lines, ""]))


DATAFLASH = {
    "FMT": (0x80, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "XKF1": (0x90, "QBccCfffffffccce", "TimeUS,C,Roll,Pitch,Yaw,VN,VE,VD,dPD,PN,PE,PD,GX,GY,GZ,OH"),
    "THR": (0x91, "Qhffff", "TimeUS,ThrIn,ThrOut,DesSpeed,Speed,AccX"),
    "STER": (0x92, "Qhfffff", "TimeUS,SteerIn,SteerOut,DesLatAcc,LatAcc,DesTurnRate,TurnRate"),
    "POS": (0x93, "QLLfff", "TimeUS,Lat,Lng,Alt,RelHomeAlt,RelOriginAlt"),
    "ATT": (0x94, "QccccCCCCB", "TimeUS,DesRoll,Roll,DesPitch,Pitch,DesYaw,Yaw,ErrRP,ErrYaw,AEKF"),
    "MSG": (0x95, "QZ", "TimeUS,Message"),
    "PARM": (0x96, "QNff", "TimeUS,Name,Value,Default"),
}
"""Number, letters and columns of ArduPilot's messages."""
STRUCT = {"c": "h", "C": "H", "L": "i", "n": "4s", "N": "16s", "Z": "64s", "e": "i"}


def write_dataflash(
    path: Path, d: Drive, source: str = "XKF1", desired: bool = True, car: bool = False
) -> Path:
    """An ArduPilot .bin with two EKF cores, or with POS and ATT; garbage in the middle."""
    layouts = {
        name: struct.Struct("<" + "".join(STRUCT.get(c, c) for c in letters))
        for name, (_, letters, _) in DATAFLASH.items()
    }

    def put(name: str, *values: Any) -> bytes:
        return b"\xa3\x95" + bytes([DATAFLASH[name][0]]) + layouts[name].pack(*values)

    out = [
        put(
            "FMT", number, layouts[name].size + 3, name.encode(), letters.encode(), columns.encode()
        )
        for name, (number, letters, columns) in DATAFLASH.items()
    ]
    out.append(put("MSG", 5, b"ArduRover V4.6.3"))
    out.append(put("PARM", 5, b"SERVO1_FUNCTION", 26.0 if car else 73.0, 0.0))
    events = [
        *((t, 0, p) for t, p in zip(d.time, d.poses, strict=True)),
        *((t, 1, c) for t, c in zip(d.command_time, d.commands, strict=True)),
    ]
    for n, (t, what, values) in enumerate(sorted(events, key=lambda event: event[:2])):
        us = round(t * 1e6)
        if what == 0:
            yaw = round(np.degrees(0.5 * np.pi - values[2]) % 360.0 * 100.0) % 36000
            if source == "XKF1":
                for core in (0, 1):
                    moved = (values[1] + core, values[0] + core)
                    out.append(put("XKF1", us, core, 0, 0, yaw, 0, 0, 0, 0, *moved, 0, 0, 0, 0, 0))
            else:
                latitude = 47.0 + np.degrees(values[1] / 6_378_137.0)
                longitude = 8.0 + np.degrees(values[0] / 6_378_137.0) / np.cos(np.radians(47.0))
                out.append(put("POS", us, round(latitude * 1e7), round(longitude * 1e7), 0, 0, 0))
                out.append(put("ATT", us, 0, 0, 0, 0, 0, yaw, 0, 0, 0))
        else:
            v, omega = values
            wanted = (v, -np.degrees(omega)) if desired else (0.0, 0.0)
            out.append(put("THR", us, 0, 100.0 * v, wanted[0], 0, 0))
            out.append(put("STER", us, 0, -4500.0 * omega / 2.0, 0, 0, wanted[1], 0))
        if n == 500:
            out.append(b"\x00\xa3\x13\xa3\x95\x07")
    path.write_bytes(b"".join(out))
    return path


def write_tlog(path: Path, d: Drive, commands: str = "set_point", car: bool = False) -> Path:
    """A .tlog of a vehicle and a ground station, as MAVProxy writes it."""
    from pymavlink.dialects.v20 import ardupilotmega as dialect

    vehicle = dialect.MAVLink(None, srcSystem=1, srcComponent=1)
    station = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    out = []

    def put(t: float, sender: Any, message: Any) -> None:
        out.append(struct.pack(">Q", round(t * 1e6)) + message.pack(sender))

    name, function = b"SERVO1_FUNCTION", 26.0 if car else 73.0
    setting = dialect.MAVLink_param_value_message(name, function, 9, 1, 0)
    put(float(d.time[0]), vehicle, setting)
    events = [
        *((t, 0, p) for t, p in zip(d.time, d.poses, strict=True)),
        *((t, 1, c) for t, c in zip(d.command_time, d.commands, strict=True)),
    ]
    for t, what, values in sorted(events, key=lambda event: event[:2]):
        ms = round((t - d.time[0]) * 1e3)
        if what == 0:
            x, y, theta = values
            yaw = np.remainder(0.5 * np.pi - theta + np.pi, 2 * np.pi) - np.pi
            turned = dialect.MAVLink_attitude_message(ms, 0, 0, yaw, 0, 0, 0)
            moved = dialect.MAVLink_local_position_ned_message(ms, y, x, 0, 0, 0, 0)
            put(t, vehicle, turned)
            put(t, vehicle, moved)
            put(t, station, dialect.MAVLink_attitude_message(ms, 0, 0, 1.0, 0, 0, 0))
        elif commands == "set_point":
            v, omega = values
            mask, rest = 0b0000_0101_1110_0111 & ~2048, (0.0,) * 6
            put(
                t,
                station,
                dialect.MAVLink_set_position_target_local_ned_message(
                    ms, 1, 1, 8, mask, 0.0, 0.0, 0.0, float(v), *rest, -float(omega)
                ),
            )
        else:
            pulses = [1500 - round(500 * values[1] / 2.0), 1500, 1500 + round(500 * values[0])]
            sticks = dialect.MAVLink_rc_channels_message(ms, 8, *pulses, *([1500] * 15), 100)
            put(t, vehicle, sticks)
    path.write_bytes(b"".join(out))
    return path


ULOG = {
    "vehicle_local_position": "uint64_t timestamp;float x;float y;float z;float heading;",
    "rover_speed_setpoint": "uint64_t timestamp;float speed_body_x;float speed_body_y;",
    "rover_rate_setpoint": "uint64_t timestamp;float yaw_rate_setpoint;",
    "sensor_combined": "uint64_t timestamp;float[3] gyro_rad;",
    "vehicle_thrust_setpoint": "uint64_t timestamp;float[3] xyz;",
    "vehicle_torque_setpoint": "uint64_t timestamp;float[3] xyz;",
}


def write_ulog(path: Path, d: Drive, speeds: bool = True) -> Path:
    """A PX4 .ulg with the local position, set-points, and a topic that is not needed."""
    out = [b"ULog\x01\x12\x35\x01" + struct.pack("<Q", 0)]

    def put(kind: str, body: bytes) -> None:
        out.append(struct.pack("<HB", len(body), ord(kind)) + body)

    put("B", bytes(40))
    for name, fields in ULOG.items():
        put("F", f"{name}:{fields}".encode())
    numbers = {name: k for k, name in enumerate(ULOG)}
    for name, number in numbers.items():
        put("A", struct.pack("<BH", 0, number) + name.encode())

    def sample(name: str, t: float, *values: float) -> None:
        body = struct.pack(f"<HQ{len(values)}f", numbers[name], round(t * 1e6), *values)
        put("D", body)

    events = [
        *((t, 0, p) for t, p in zip(d.time, d.poses, strict=True)),
        *((t, 1, c) for t, c in zip(d.command_time, d.commands, strict=True)),
    ]
    for t, what, values in sorted(events, key=lambda event: event[:2]):
        if what == 0:
            yaw = np.remainder(0.5 * np.pi - values[2] + np.pi, 2 * np.pi) - np.pi
            sample("vehicle_local_position", t, values[1], values[0], 0.0, yaw)
            sample("sensor_combined", t, 0.0, 0.0, 0.0)
        elif speeds:
            sample("rover_speed_setpoint", t, values[0], float("nan"))
            sample("rover_rate_setpoint", t, -values[1])
        else:
            sample("vehicle_thrust_setpoint", t, values[0], 0.0, 0.0)
            sample("vehicle_torque_setpoint", t, 0.0, 0.0, -values[1] / 2.0)
    path.write_bytes(b"".join(out))
    return path
