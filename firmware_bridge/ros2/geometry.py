"""Places of ROS messages in the plane, and where one frame lies in another."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

FARTHEST = 1e5
"""Translations beyond this are no robot's [m]."""
UNIT = 0.1
"""A quaternion's squared length may differ from 1 by so much."""
LEVEL = 0.97
"""Cosine of the largest tilt of a map or a scanner, 14 degrees: a plane that is tilted farther cuts
the floor's."""


class Place(NamedTuple):
    """A place in the plane, seen from above."""

    x: float
    """[m]"""
    y: float
    """[m]"""
    theta: float
    """Of the x axis, counter-clockwise [rad]."""
    upright: float = 1.0
    """Cosine of the tilt: 1 upright, -1 upside down."""

    def of(self, inner: Place) -> Place:
        """Where `inner`, a place in a frame that lies here, is.

        Examples
        --------
        >>> Place(1.0, 2.0, 0.0).of(Place(0.5, 0.0, 0.25))
        Place(x=1.5, y=2.0, theta=0.25, upright=1.0)
        """
        cos, sin = math.cos(self.theta), math.sin(self.theta)
        return Place(
            self.x + cos * inner.x - sin * inner.y,
            self.y + sin * inner.x + cos * inner.y,
            self.theta + inner.theta,
            self.upright * inner.upright,
        )

    @property
    def inverse(self) -> Place:
        """Where the outer frame lies as seen from here."""
        back = Place(0.0, 0.0, -self.theta).of(Place(-self.x, -self.y, 0.0))
        return back._replace(theta=-self.theta)


Lookup = Callable[[str, str], Place | None]
"""Where the second frame lies in the first; None if that is not known."""
HERE = Place(0.0, 0.0, 0.0)


def place_of(position: Any, orientation: Any) -> Place | None:
    """Give the place of a position [m] and a quaternion; None if they are none."""
    x, y, z, w = orientation.x, orientation.y, orientation.z, orientation.w
    length = x * x + y * y + z * z + w * w
    # NaN fails every comparison
    far = all(abs(c) <= FARTHEST for c in (position.x, position.y, position.z))
    if not far or not abs(length - 1.0) <= UNIT:
        return None
    theta = math.atan2(x * y + z * w, 0.5 * length - y * y - z * z)
    upright = 1.0 - 2.0 * (x * x + y * y) / length
    return Place(float(position.x), float(position.y), theta, upright)


def seconds(stamp: Any) -> float:
    """Time of a stamp [s]."""
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


class Transforms:
    """Looks frames up in TF; `tf2_ros` is imported for the first pair of frames that differ.

    `node`: listens to /tf and /tf_static. `oldest`: a transform that moves and is older is not
    believed [s].
    """

    def __init__(self, node: Any, oldest: float) -> None:
        self._node, self._oldest = node, oldest
        self._buffer: Any = None
        self.missing = ""
        """Why none is known, in words, if `tf2_ros` is not installed; else empty."""

    def lookup(self, target: str, source: str) -> Place | None:
        """Where the frame `source` lies in `target`; None if no chain of fresh ones leads there."""
        if target == source:
            return HERE
        if self._buffer is None and not self.missing:
            self._listen()
        if self.missing:
            return None
        try:
            found = self._buffer.lookup_transform(target, source, self._none)
        except self._refusal:
            return None
        stamp = seconds(found.header.stamp)  # zero of a static one
        now = 1e-9 * self._node.get_clock().now().nanoseconds
        if stamp and now - stamp > self._oldest:
            return None
        return place_of(found.transform.translation, found.transform.rotation)

    def _listen(self) -> None:
        try:
            import tf2_ros
        except ImportError:
            self.missing = "tf2_ros is not installed (apt install ros-$ROS_DISTRO-tf2-ros-py)"
            return
        from rclpy.time import Time

        self._none, self._refusal = Time(), tf2_ros.TransformException
        self._buffer = tf2_ros.Buffer()
        self._listener = tf2_ros.TransformListener(self._buffer, self._node)
