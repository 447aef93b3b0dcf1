"""Places of ROS messages in the plane, frames in another, and the paths of other planners."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

import kmpc_lite as kl
from firmware_bridge.messages import State
from firmware_bridge.sensors.pose import PoseFilter, SourcePose

FARTHEST = 1e5  # translations beyond this are no robot's [m]
UNIT = 0.1  # a quaternion's squared length may differ from 1 by so much
LEVEL = 0.97
"""Cosine of the largest tilt of a map or a scanner, 14 degrees: a plane that is tilted farther cuts
the floor's."""
SPACING = 0.1
"""Of the poses that are followed [m]: grids' planners give one a cell, with the cells' corners."""
CLOSE, WOBBLE = 1e-4, 0.02
"""Points nearer to each other are one [m]; the path is smoothed by so much [m]: half a usual cell.
"""
END = 0.05  # a path that ends farther from the goal leads elsewhere [m]
NONE = "no path to this goal on the topic plan"


class Place(NamedTuple):
    """A place in the plane, seen from above."""

    x: float  # [m]
    y: float  # [m]
    theta: float  # of the x axis, counter-clockwise [rad]
    upright: float = 1.0  # cosine of the tilt: 1 upright, -1 upside down

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
        self.missing = ""  # why none is known, in words, if `tf2_ros` is not installed; else empty

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


class GivenPath:
    """A planner that finds what another one has published.

    `places`: gives the newest path, in the frame that is driven in. `by_poses`: whether its
    headings count, as a car's; else a robot looks where it drives.
    """

    def __init__(self, places: Callable[[], Sequence[Place]], by_poses: bool) -> None:
        self._places, self._by_poses = places, by_poses
        self._found: kl.Path | str = NONE

    def begin(self, request: kl.PathRequest) -> None:
        """Take the part of the path that lies before the robot."""
        poses = np.array([place[:3] for place in self._places()]).reshape(-1, 3)
        self._found = NONE
        if len(poses) < 2 or np.hypot(*(poses[-1] - request.goal)[:2]) > END:
            return
        nearest = int(np.hypot(*(poses[:, :2] - request.start[:2]).T).argmin())
        rest = np.vstack([request.start, poses[nearest + 1 :], request.goal])
        if not self._by_poses:
            rest = _looking_ahead(rest)
        rest[:, 2] = np.unwrap(rest[:, 2])
        if len(rest) < 2:
            return
        clear = request.distances(rest[1:-1, :2]) - request.inflation
        if clear.min(initial=np.inf) < 0.0:
            self._found = "something stands on the path of the topic plan"
            return
        self._found = kl.Path(rest, clearance=float(min(clear.min(initial=1.0), 1.0)))

    def advance(self, quanta: int) -> int:
        """Nothing is left to do."""
        return 0

    def path(self) -> kl.Path | str:
        """The path, or why there is none."""
        return self._found


def _looking_ahead(poses: np.ndarray) -> np.ndarray:
    """Poses `SPACING` apart, each looking along the path; turns on the spot at either end."""
    from scipy.interpolate import splev, splprep

    steps = np.hypot(*np.diff(poses[:, :2], axis=0).T)
    points = poses[np.concatenate([[True], steps > CLOSE]), :2]
    if len(points) < 2:
        return poses
    degree = min(3, len(points) - 1)
    spline, along = splprep(points.T, k=degree, s=len(points) * WOBBLE**2)
    count = max(int(steps.sum() / SPACING), 1)
    even = np.linspace(along[0], along[-1], count + 1)
    places, slopes = (np.column_stack(splev(even, spline, der=order)) for order in (0, 1))
    places[0], places[-1] = poses[0, :2], poses[-1, :2]
    headings = np.arctan2(slopes[:, 1], slopes[:, 0])
    return np.vstack([poses[:1], np.column_stack([places, headings]), poses[-1:]])


FASTEST = 100.0  # speeds beyond this are no robot's [m/s, rad/s]
KEPT = 500  # odometry that is kept for a localisation that needs time: ten seconds of 50 Hz
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
        self.base = "base_link"  # the robot's own frame, as odometry says
        self._odom_frame = frame
        self._newest: State | None = None  # in the odometry's frame
        self._seen: deque[tuple[float, Place]] = deque(maxlen=KEPT)  # stamps and places of odometry
        self._corrected: Place | None = None
        self.refused = 0  # poses that are not finite, or have no orientation

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
