"""Types of ROS 2 messages: definitions, hashes and CDR, from rosbags' type stores."""

from __future__ import annotations

from contextlib import suppress
from typing import Any

from kmpc_lite.learn.formats.ackermann import ACKERMANN_STAMPED, FIELDS

DISTRIBUTIONS = ("jazzy", "kilted", "humble")
NO_HASH = "TypeHashNotSupported"
"""Stands for a hash in Humble, which has none: types that differ are not distinguished there."""
ODOMETRY = "nav_msgs/msg/Odometry"
TF = "tf2_msgs/msg/TFMessage"
SCAN = "sensor_msgs/msg/LaserScan"
GRID = "nav_msgs/msg/OccupancyGrid"
GRID_UPDATE = "map_msgs/msg/OccupancyGridUpdate"
POSE = "geometry_msgs/msg/PoseStamped"
CLOCK = "rosgraph_msgs/msg/Clock"
TWIST = "geometry_msgs/msg/Twist"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
PATH = "nav_msgs/msg/Path"
MARKERS = "visualization_msgs/msg/MarkerArray"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
LARGEST = {
    ODOMETRY: 4096,
    TF: 2**18,
    SCAN: 2**20,
    GRID: 2**25,
    GRID_UPDATE: 2**25,
    POSE: 4096,
    CLOCK: 256,
    TWIST: 256,
    TWIST_STAMPED: 4096,
    ACKERMANN_STAMPED: 4096,
    PATH: 2**18,
    MARKERS: 2**20,
    DIAGNOSTICS: 2**18,
}
"""Longest message that is decoded [bytes]; a map of 5000 x 5000 cells has 25 million."""
GRID_UPDATE_TEXT = """std_msgs/Header header
int32 x
int32 y
uint32 width
uint32 height
int8[] data"""
"""map_msgs has no store of its own, nor has ackermann_msgs; their definitions are the same in all
distributions."""


class MessageTypes:
    """The messages of one distribution.

    Parameters
    ----------
    distribution : str
        One of `DISTRIBUTIONS`.
    """

    def __init__(self, distribution: str = "jazzy") -> None:
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        self._store: Any = get_typestore(Stores(f"ros2_{distribution}"))
        for kind, text in {**FIELDS, GRID_UPDATE: GRID_UPDATE_TEXT}.items():
            self._store.register(get_types_from_msg(text, kind))
        self._hashed = distribution != "humble"

    def type_hash(self, kind: str) -> str:
        """Hash of a type (REP 2016), as the distribution's topics carry it."""
        return str(self._store.hash_rihs01(kind)) if self._hashed else NO_HASH

    def definition(self, kind: str) -> str:
        """Definition of a type, with those of its parts, as a bag has it."""
        return str(self._store.generate_msgdef(kind, ros_version=2)[0])

    def make(self, kind: str, **fields: Any) -> Any:
        """Make a message of all its fields."""
        return self._store.types[kind](**fields)

    def encode(self, message: Any) -> bytes:
        """CDR of a message, with its header of four bytes."""
        return bytes(self._store.serialize_cdr(message, message.__msgtype__))

    def prepare(self, kind: str) -> None:
        """Make ready to decode a type, which takes a quarter of a second once."""
        with suppress(ValueError):
            self.decode(b"\0\1\0\0", kind)

    def decode(self, data: bytes, kind: str) -> Any:
        """Read a message; ValueError for whatever is none."""
        if len(data) > LARGEST[kind]:
            raise ValueError(f"{len(data):,} bytes, expected at most {LARGEST[kind]:,}")
        try:
            return self._store.deserialize_cdr(data, kind)
        except MemoryError:
            raise
        except Exception as error:  # rosbags has exceptions of its own, and asserts
            raise ValueError(f"not a {kind}: {type(error).__name__}") from error
