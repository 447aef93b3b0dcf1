"""What a node knows of the messages that it was given."""

from __future__ import annotations

import math
from functools import reduce
from typing import Any

from firmware_bridge.ros2.inputs import Inputs
from firmware_bridge.ros2.message_types import MessageTypes
from firmware_bridge.ros2.options import Ros2Options, read_topics
from kmpc_lab.emulator.ros2.messages import RobotMessages

TYPES = MessageTypes()
MAKE = RobotMessages(TYPES)
EPOCH = 1.7e9
NAN = math.nan


def inputs(*topics: str, **options: Any) -> Inputs:
    return Inputs(Ros2Options(topics=read_topics(topics, "/"), **options))


def odometry(here: Inputs, now: float, pose: Any, stamp: float | None = None, **frames: str) -> Any:
    names = {"frame": "odom", "base": "base_link", **frames}
    stamp = EPOCH + now if stamp is None else stamp
    message = MAKE.odometry(pose, (0.2, 0.1), stamp, names["frame"], names["base"])
    here.pose.take_odometry(message, now)
    return message


def transform(here: Inputs, now: float, parent: str, child: str, pose: Any, **how: bool) -> None:
    message = MAKE.transforms((parent, child, pose), time=EPOCH + now)
    here.transforms.take(message, now, how.get("static", False))


def spoil(message: Any, changes: dict[str, Any]) -> Any:
    """A message with some of its parts changed, such as ``info.width``."""
    for path, value in changes.items():
        *parts, last = path.split(".")
        setattr(reduce(getattr, parts, message), last, value)
    return message
