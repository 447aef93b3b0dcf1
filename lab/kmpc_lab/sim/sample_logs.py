"""Logs to try things with: drives of a simulated robot, as an autopilot and as ROS write them."""

from __future__ import annotations

import math
import os
import struct
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.types import Array

PERIOD = 0.1  # between two rows [s]
HEAD = b"\xa3\x95"
FORMATS = {
    "FMT": (128, "BBnNZ", "Type,Length,Name,Format,Columns"),
    "XKF1": (144, "QBCff", "TimeUS,C,Yaw,PN,PE"),
    "THR": (145, "Qff", "TimeUS,ThrOut,DesSpeed"),
    "STER": (146, "Qff", "TimeUS,SteerOut,DesTurnRate"),
}
"""Number, letters and columns of messages of an ArduPilot log."""
LETTERS = {"C": "H", "n": "4s", "N": "16s", "Z": "64s"}


def ardupilot_log(path: str | os.PathLike[str], seconds: float = 120.0, seed: int = 0) -> Path:
    """Write a .bin of a rover that lags, as ArduPilot logs it.

    Parameters
    ----------
    path : path
        Of the file.
    seconds : float
        How long the rover drives [s].
    seed : int
        Of its commands and its slip.
    """
    layouts = {
        name: struct.Struct("<" + "".join(LETTERS.get(letter, letter) for letter in letters))
        for name, (_, letters, _) in FORMATS.items()
    }

    def put(name: str, *values: Any) -> bytes:
        return HEAD + bytes([FORMATS[name][0]]) + layouts[name].pack(*values)

    out = [
        put("FMT", number, layouts[name].size + 3, name.encode(), form.encode(), columns.encode())
        for name, (number, form, columns) in FORMATS.items()
    ]
    for time, (x, y, theta), (v, omega) in zip(*_drive(seconds, seed), strict=True):
        us = round(time * 1e6)
        # north is 0 and east 90 degrees
        yaw = round(math.degrees(0.5 * math.pi - theta) % 360.0 * 100.0) % 36000
        turn = -math.degrees(omega)
        out.append(put("XKF1", us, 0, yaw, y, x))
        out += [put("THR", us, 100.0 * v, v), put("STER", us, 45.0 * turn, turn)]
    path = Path(path)
    path.write_bytes(b"".join(out))
    return path


def ros_bag(path: str | os.PathLike[str], seconds: float = 120.0, seed: int = 0) -> Path:
    """Write a rosbag2 with ``/odom`` and ``/cmd_vel`` of a robot that lags (extra `logs`).

    Parameters
    ----------
    path : path
        Of a new folder.
    seconds : float
        How long the robot drives [s].
    seed : int
        Of its commands and its slip.
    """
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_JAZZY)
    odometry, twist = "nav_msgs/msg/Odometry", "geometry_msgs/msg/Twist"

    def make(kind: str, *values: Any) -> Any:
        return store.types[kind](*values)

    def vector(x: float, z: float = 0.0) -> Any:
        return make("geometry_msgs/msg/Vector3", x, 0.0, z)

    with Writer(Path(path), version=9) as writer:
        poses = writer.add_connection("/odom", odometry, typestore=store)
        commands = writer.add_connection("/cmd_vel", twist, typestore=store)
        for time, (x, y, theta), (v, omega) in zip(*_drive(seconds, seed), strict=True):
            ns = round(time * 1e9)
            stamp = make("builtin_interfaces/msg/Time", ns // 10**9, ns % 10**9)
            turn = (0.0, 0.0, math.sin(theta / 2), math.cos(theta / 2))
            pose = make(
                "geometry_msgs/msg/Pose",
                make("geometry_msgs/msg/Point", x, y, 0.0),
                make("geometry_msgs/msg/Quaternion", *turn),
            )
            still = make(twist, vector(0.0), vector(0.0))
            message = make(
                odometry,
                make("std_msgs/msg/Header", stamp, "odom"),
                "base_link",
                make("geometry_msgs/msg/PoseWithCovariance", pose, np.zeros(36)),
                make("geometry_msgs/msg/TwistWithCovariance", still, np.zeros(36)),
            )
            writer.write(poses, ns, store.serialize_cdr(message, odometry))
            command = make(twist, vector(v), vector(0.0, omega))
            writer.write(commands, ns, store.serialize_cdr(command, twist))
    return Path(path)


def _drive(seconds: float, seed: int) -> tuple[list[float], Array, Array]:
    """Times [s], poses (n, 3) and commands (n, 2) of a drive."""
    plant = LaggingDrive(lag=0.15, slip=0.03, seed=seed)
    steps = round(seconds / PERIOD)
    noise = (0.002, 0.002, 0.003)
    log = drive_log(plant, 1, steps, PERIOD, seed, hold=15, pose_noise=noise)
    (episode,) = log.episodes
    times = [1000.0 + PERIOD * k for k in range(steps)]
    return times, episode.states[:-1], episode.inputs
