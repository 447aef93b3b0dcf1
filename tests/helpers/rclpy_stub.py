"""A stub of the part of rclpy's interface that examples/ros2 uses. No ROS runs behind it.

Message types come from rosbags' type store. As rclpy does, it refuses fields that a type does not
have and numbers of another type; what is published is encoded, so that every field must fit.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import fields
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from kmpc_lite.learn.formats.ackermann import FIELDS

BASE = {"string": "", "bool": False, "float32": 0.0, "float64": 0.0}
MODULES = {
    "ackermann_msgs.msg": ("AckermannDriveStamped",),
    "geometry_msgs.msg": ("PoseStamped", "Twist"),
    "nav_msgs.msg": ("Odometry",),
    "sensor_msgs.msg": ("LaserScan",),
}


class Messages:
    """Message types of one distribution whose fields have defaults, as rclpy's have."""

    def __init__(self, distribution: str) -> None:
        self.store = get_typestore(Stores(f"ros2_{distribution}"))
        for name, text in FIELDS.items():
            self.store.register(get_types_from_msg(text, name))

    def make(self, name: str) -> Any:
        """Make an empty message."""
        kind, (_, definition) = self.store.types[name], self.store.fielddefs[name]
        return kind(**{field: self._default(shape) for field, shape in definition})

    def kind(self, name: str) -> type:
        """Type whose instances are empty messages at first."""
        made = self

        class Made(self.store.types[name]):  # type: ignore[misc, name-defined]
            __slots__ = ()

            def __init__(self) -> None:
                empty = made.make(name)
                for field in fields(empty):
                    object.__setattr__(self, field.name, getattr(empty, field.name))

        Made.__name__ = name.rpartition("/")[2]
        return Made

    def _default(self, shape: Any) -> Any:
        node, what = shape
        match node.name:
            case "NAME":
                return self.make(what)
            case "BASE":
                return BASE.get(what[0], 0)
            case "ARRAY":
                return np.zeros(what[1])
            case _:
                return np.zeros(0, np.float32)

    def check(self, message: Any, name: str) -> None:
        """Refuse a message that rclpy would not take."""
        for field, (node, what) in self.store.fielddefs[name][1]:
            value = getattr(message, field)
            if node.name == "NAME":
                self.check(value, what)
            elif node.name == "BASE" and what[0].startswith("float"):
                assert type(value) is float, f"{name}.{field}: expected a float, got {value!r}"
        self.store.serialize_cdr(message, name)


class Node:
    """What a node asks rclpy for; `network` holds what the test gives and gets."""

    network: Network

    def __init__(self, name: str) -> None:
        self.name = name
        self.network.node = self

    def declare_parameter(self, name: str, value: Any) -> SimpleNamespace:
        return SimpleNamespace(value=self.network.parameters.get(name, value))

    def create_subscription(
        self, kind: type, topic: str, callback: Callable[[Any], None], qos: Any
    ) -> None:
        self.network.callbacks[topic] = (kind, callback)

    def create_publisher(self, kind: type, topic: str, qos: Any) -> SimpleNamespace:
        def publish(message: Any) -> None:
            assert type(message) is kind
            self.network.messages.check(message, kind.__msgtype__)  # type: ignore[attr-defined]
            self.network.published.append((topic, message))

        return SimpleNamespace(publish=publish)

    def create_timer(self, period: float, callback: Callable[[], None]) -> None:
        self.network.timer = (period, callback)

    def get_clock(self) -> SimpleNamespace:
        stamp = self.network.messages.make("builtin_interfaces/msg/Time")
        stamp.sec = int(self.network.now)
        nanoseconds = round(1e9 * self.network.now)
        now = SimpleNamespace(nanoseconds=nanoseconds, to_msg=lambda: stamp)
        return SimpleNamespace(now=lambda: now)

    def get_logger(self) -> SimpleNamespace:
        def log(text: str, throttle_duration_sec: float = 0.0) -> None:
            self.network.logged.append(text)

        return SimpleNamespace(info=log, error=log)


class Network:
    """Topics, timer and clock of one node under test."""

    def __init__(self, distribution: str, parameters: dict[str, Any]) -> None:
        self.messages, self.parameters = Messages(distribution), parameters
        self.node: Any = None
        self.callbacks: dict[str, tuple[type, Callable[[Any], None]]] = {}
        self.published: list[tuple[str, Any]] = []
        self.timer: tuple[float, Callable[[], None]] = (0.0, lambda: None)
        self.logged: list[str] = []
        self.now = 0.0

    def install(self, monkeypatch: Any) -> None:
        """Let `import rclpy` and the message packages find this."""
        modules = {name: ModuleType(name) for name in ("rclpy", "rclpy.node", "rclpy.qos")}
        modules["rclpy.node"].Node = type("Node", (Node,), {"network": self})  # type: ignore[attr-defined]
        modules["rclpy.qos"].qos_profile_sensor_data = object()  # type: ignore[attr-defined]
        for name, kinds in MODULES.items():
            package = name.partition(".")[0]
            modules[package] = ModuleType(package)
            modules[name] = ModuleType(name)
            for kind in kinds:
                setattr(modules[name], kind, self.messages.kind(f"{package}/msg/{kind}"))
        for name, module in modules.items():
            monkeypatch.setitem(sys.modules, name, module)

    def stamped(self, topic: str, frame: str, age: float = 0.0) -> Any:
        """Make an empty message of a topic's type with a stamp."""
        message = self.callbacks[topic][0]()
        message.header.frame_id = frame
        message.header.stamp.sec = int(self.now - age)
        message.header.stamp.nanosec = int(1e9 * ((self.now - age) % 1.0))
        return message

    def send(self, topic: str, message: Any) -> None:
        """Bring a message to the node, as its bytes would."""
        kind, callback = self.callbacks[topic]
        self.messages.check(message, kind.__msgtype__)  # type: ignore[attr-defined]
        callback(message)
