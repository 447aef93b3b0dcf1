"""zenoh-ros2-sdk, an independent client of rmw_zenoh's protocol; it fetches no definitions."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from rosbags.typesys import Stores, get_typestore
from zenoh_ros2_sdk.publisher import ROS2Publisher
from zenoh_ros2_sdk.session import ZenohSession
from zenoh_ros2_sdk.subscriber import ROS2Subscriber

from firmware_bridge.ros2.message_types import MessageTypes

HOST = "127.0.0.1"


@contextmanager
def ros_client(port: int, types: MessageTypes) -> Iterator[RosClient]:
    """A client with a session of its own; the library has one for the whole process."""
    ZenohSession._instance = None
    client = RosClient(port, types)
    try:
        yield client
    finally:
        client.session.session.close()
        ZenohSession._instance = None


class RosClient:
    def __init__(self, port: int, types: MessageTypes) -> None:
        self.session = ZenohSession.get_instance(HOST, port)
        self.session.store = get_typestore(Stores.ROS2_JAZZY)
        self._port, self._types = port, types

    def publisher(self, topic: str, kind: str) -> ROS2Publisher:
        return ROS2Publisher(topic, kind, **self._where(kind))

    def subscriber(self, topic: str, kind: str, callback: Any, qos: Any = None) -> ROS2Subscriber:
        return ROS2Subscriber(topic, kind, callback, qos=qos, **self._where(kind))

    def _where(self, kind: str) -> dict[str, Any]:
        self.session._registered_types[kind] = kind
        type_hash = self._types.type_hash(kind)
        return {"router_ip": HOST, "router_port": self._port, "type_hash": type_hash}
