"""The robot's pose: odometry, checked, on our clock, where a localisation says its frame lies."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace
from typing import Any

from firmware_bridge.messages import State
from firmware_bridge.ros2.geometry import HERE, Lookup, Place, place_of, seconds
from firmware_bridge.sensors.pose import PoseFilter, SourcePose

FASTEST = 100.0
"""Speeds beyond this are no robot's [m/s, rad/s]."""
KEPT = 500
"""Odometry that is kept for a localisation that needs time: ten seconds of 50 Hz."""
APART = 0.1
"""Farthest an odometry may lie in time from the localisation that it is compared with [s]."""


class PoseInput:
    """Where the robot is, in the frame that is driven in.

    `frame`: frame that is driven in: the map's. `lookup`: see `Lookup`; None if `amcl_pose` alone
    says where the odometry's frame lies.
    """

    def __init__(self, frame: str, lookup: Lookup | None) -> None:
        self._frame, self._lookup = frame, lookup
        self.filter = PoseFilter()
        self.base = "base_link"
        """The robot's own frame, as odometry says."""
        self._odom_frame = frame
        self._newest: State | None = None
        """In the odometry's frame."""
        self._seen: deque[tuple[float, Place]] = deque(maxlen=KEPT)
        """Stamps and places of odometry."""
        self._corrected: Place | None = None
        self.refused = 0
        """Poses that are not finite, or have no orientation."""

    def take_odometry(self, message: Any, local: float, now: float) -> None:
        """Take an Odometry that came at `now`, whose stamp is `local` on a clock of ours [s]."""
        twist = message.twist.twist
        at = place_of(message.pose.pose.position, message.pose.pose.orientation)
        v, vy, omega = float(twist.linear.x), float(twist.linear.y), float(twist.angular.z)
        # NaN fails every comparison
        if at is None or not all(abs(speed) <= FASTEST for speed in (v, vy, omega)):
            self.refused += 1
            return
        believed = self.filter.believe(SourcePose(*at[:3], local), now)
        if believed is None:
            return
        # an odometry without names of frames is of the frame that is driven in
        self._odom_frame = message.header.frame_id or self._frame
        self.base = message.child_frame_id or self.base
        self._seen.append((seconds(message.header.stamp), at))
        self._newest = State(believed.x, believed.y, believed.theta, v, omega, believed.stamp, vy)

    def take_localisation(self, message: Any) -> None:
        """Take a PoseWithCovarianceStamped: where the robot was on the map, at its stamp."""
        at = place_of(message.pose.pose.position, message.pose.pose.orientation)
        stamp = seconds(message.header.stamp)
        then = min(self._seen, key=lambda seen: abs(seen[0] - stamp), default=(-math.inf, HERE))
        if at is None or message.header.frame_id != self._frame or abs(then[0] - stamp) > APART:
            self.refused += 1
            return
        self._corrected = at.of(then[1].inverse)

    def _origin(self) -> Place | None:
        """Where the odometry's frame lies in the frame that is driven in."""
        if self._odom_frame == self._frame:
            return HERE
        if self._lookup is None:
            return self._corrected
        return self._lookup(self._frame, self._odom_frame)

    def state(self) -> State | None:
        """Newest pose; None before the first, or without a localisation."""
        newest, origin = self._newest, self._origin()
        if newest is None or origin is None:
            return None
        at = origin.of(Place(newest.x, newest.y, newest.theta))
        return replace(newest, x=at.x, y=at.y, theta=at.theta)

    def problem(self, now: float) -> str:
        """Why there is no pose, in words; empty if there is one."""
        if self._newest is None:
            return "odometry is not finite" if self.refused else "no odometry yet"
        if self._origin() is None:
            where = "on amcl_pose" if self._lookup is None else "in TF"
            return f"no fresh {self._frame} -> {self._odom_frame} {where}"
        return self.filter.fault(now)

    def on_our_clock(self, local: float) -> float:
        """When a stamp `local` of another sensor was, as the odometry's stamps tell it [s]."""
        way = self.filter.shortest_way
        return local + (0.0 if math.isnan(way) else way)
