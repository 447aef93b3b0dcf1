"""Stubs of what the wheels of ROS 2 lack: tf2_ros and ackermann_msgs. No ROS package is behind it.

They have the names and signatures of the packages, as far as `firmware_bridge.ros2` uses them.
"""

from __future__ import annotations

import math
import sys
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest


class TransformException(Exception):
    """Stub of tf2_ros.TransformException."""


class Buffer:
    """Stub of tf2_ros.Buffer: knows pairs of frames only, x, y, heading and stamp [s]."""

    known: dict[tuple[str, str], tuple[float, float, float, float]] = {}
    roll = 0.0

    def lookup_transform(self, target: str, source: str, time: Any) -> Any:
        if (target, source) not in self.known:
            raise TransformException(f"{source} is not connected to {target}")
        x, y, theta, stamp = self.known[target, source]
        at = SimpleNamespace(sec=int(stamp), nanosec=int(1e9 * (stamp % 1.0)))
        half, tilt = 0.5 * theta, 0.5 * self.roll
        turn = SimpleNamespace(
            x=math.sin(tilt) * math.cos(half),
            y=math.sin(tilt) * math.sin(half),
            z=math.cos(tilt) * math.sin(half),
            w=math.cos(tilt) * math.cos(half),
        )
        moved = SimpleNamespace(translation=SimpleNamespace(x=x, y=y, z=0.3), rotation=turn)
        return SimpleNamespace(header=SimpleNamespace(stamp=at), transform=moved)


class AckermannDriveStamped:
    """Stub of ackermann_msgs.msg.AckermannDriveStamped."""

    def __init__(self) -> None:
        self.header = SimpleNamespace(stamp=None, frame_id="")
        self.drive = SimpleNamespace(speed=0.0, steering_angle=0.0)


def install(monkeypatch: pytest.MonkeyPatch) -> type[Buffer]:
    """Let `import tf2_ros` and `ackermann_msgs.msg` find these; gives a buffer of its own."""
    buffer = type("Buffer", (Buffer,), {"known": {}})
    tf2 = ModuleType("tf2_ros")
    tf2.Buffer, tf2.TransformException = buffer, TransformException  # type: ignore[attr-defined]
    tf2.TransformListener = lambda buffer, node: None  # type: ignore[attr-defined]
    ackermann, messages = ModuleType("ackermann_msgs"), ModuleType("ackermann_msgs.msg")
    messages.AckermannDriveStamped = AckermannDriveStamped  # type: ignore[attr-defined]
    for module in (tf2, ackermann, messages):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    return buffer
