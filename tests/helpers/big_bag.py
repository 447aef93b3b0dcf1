"""A bag as large as one likes, written without keeping it: poses, commands, a camera."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from foreign_logs import _Messages, drive


def write_big_bag(path: Path, kind: str, size: int, rate: float = 200.0) -> Path:
    """Write a bag of about `size` bytes: odometry at `rate`, cmd_vel at 10 Hz, a camera at 5 Hz."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    first = kind == "ros1"
    store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_JAZZY)
    plugins = {"sqlite3": StoragePlugin.SQLITE3, "mcap": StoragePlugin.MCAP}
    made = Writer1(path) if first else Writer2(path, version=9, storage_plugin=plugins[kind])
    make = _Messages(store.types, first, 0.0)
    to_bytes = store.serialize_ros1 if first else store.serialize_cdr
    kinds = {
        "/odom": "nav_msgs/msg/Odometry",
        "/cmd_vel": "geometry_msgs/msg/Twist",
        "/camera": "std_msgs/msg/UInt8MultiArray",
    }
    with made as writer:
        places = {n: writer.add_connection(n, k, typestore=store) for n, k in kinds.items()}
        for name, t, message in _messages(make, size, rate):
            writer.write(places[name], round(t * 1e9), to_bytes(message, kinds[name]))
    return path


def _messages(make: _Messages, size: int, rate: float) -> Iterator[tuple[str, float, Any]]:
    """Messages in the order of their times until they take `size` bytes."""
    picture = np.random.default_rng(0).integers(0, 256, 40_000).astype(np.uint8)
    layout = make.make("std_msgs/msg/MultiArrayLayout", [], 0)
    image = make.make("std_msgs/msg/UInt8MultiArray", layout, picture)
    written, minute = 0, 0
    while written < size:
        d = drive(60.0, rate=rate, seed=minute, start=1000.0 + 60.0 * minute, delay=0.2)
        events = [
            *((t, "/odom", p) for t, p in zip(d.time, d.poses, strict=True)),
            *((t, "/cmd_vel", c) for t, c in zip(d.command_time, d.commands, strict=True)),
            *((t, "/camera", None) for t in d.time[:: int(rate / 5.0)]),
        ]
        for t, name, values in sorted(events, key=lambda event: event[0]):
            if name == "/odom":
                message, length = make.odometry(t, values), 750
            elif name == "/cmd_vel":
                message, length = make.command(t, values), 90
            else:
                message, length = image, len(picture)
            written += length
            yield name, float(t), message
        minute += 1
