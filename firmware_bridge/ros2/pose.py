"""The robot's pose: odometry or TF, checked, on our clock, in the frame of map and goal."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from firmware_bridge.messages import State
from firmware_bridge.ros2.clock import RosClock
from firmware_bridge.ros2.transforms import (
    Transforms,
    bare,
    planar,
    planar_matrix,
    pose_matrix,
    stamp_of,
)
from firmware_bridge.sensors.pose import PoseFilter, SourcePose

SHORTEST = 0.02
"""Smallest time between two poses for a speed [s], if TF alone gives the pose."""
LONGEST = 0.5
"""Poses farther apart tell no speed [s]."""

FASTEST = 100.0
"""Speeds beyond this are no robot's [m/s, rad/s]."""


class PoseInput:
    """Where the robot is.

    Parameters
    ----------
    frame : str
        Frame in which the robot is driven: the map's.
    base : str
        The robot's own frame, where TF alone tells the pose.
    transforms : Transforms
        Bring odometry into `frame`.
    clock : RosClock
        Of the stamps.
    """

    def __init__(self, frame: str, base: str, transforms: Transforms, clock: RosClock) -> None:
        self._frame, self._transforms, self._clock = frame, transforms, clock
        self.filter = PoseFilter()
        self.base = base
        """The robot's frame; odometry says its own."""
        self._source_frame = frame
        self._newest: State | None = None
        """In the source's frame."""
        self.refused = 0
        """Poses that are not finite, or have no orientation."""

    def take_odometry(self, message: Any, now: float) -> None:
        """Take an Odometry message that came at `now` [s]."""
        pose, twist = message.pose.pose, message.twist.twist
        matrix = pose_matrix(pose.position, pose.orientation)
        v, vy, omega = float(twist.linear.x), float(twist.linear.y), float(twist.angular.z)
        # NaN fails every comparison
        if matrix is None or not all(abs(speed) <= FASTEST for speed in (v, vy, omega)):
            self.refused += 1
            return
        at = planar(matrix)
        said = SourcePose(at.x, at.y, at.theta, self._clock.local(stamp_of(message.header), now))
        believed = self.filter.believe(said, now)
        if believed is None:
            return
        # an odometry without names of frames is of the frame that is driven in
        self._source_frame = bare(message.header.frame_id) or self._frame
        self.base = bare(message.child_frame_id) or self.base
        self._newest = State(believed.x, believed.y, believed.theta, v, omega, believed.stamp, vy)

    def take_transforms(self, now: float) -> None:
        """Read the pose of TF alone: the first frame above the robot that moves carries it."""
        frame, link = self.base, self._transforms.link(self.base)
        while link is not None and math.isinf(link.received):
            frame = link.parent
            link = self._transforms.link(frame) if frame != self._frame else None
        matrix = None if link is None else self._transforms.lookup(link.parent, self.base, now)
        if link is None or matrix is None:
            return
        at = planar(matrix)
        stamp = self._clock.local(link.stamp, now)
        before = self._newest
        believed = self.filter.believe(SourcePose(at.x, at.y, at.theta, stamp), now)
        if believed is None:
            return
        self._source_frame = link.parent
        here = State(believed.x, believed.y, believed.theta, 0.0, 0.0, believed.stamp)
        self._newest = _with_speeds(before, here)

    def state(self, now: float) -> State | None:
        """Newest pose in the frame that is driven in; None before the first, or without a chain."""
        newest = self._newest
        if newest is None:
            return None
        if self._source_frame == self._frame:
            return newest
        found = self._transforms.lookup(self._frame, self._source_frame, now)
        if found is None:
            return None
        at = planar(found @ planar_matrix(newest.x, newest.y, newest.theta))
        return replace(newest, x=at.x, y=at.y, theta=at.theta)

    def problem(self, now: float) -> str:
        """Why there is no pose, in words; empty if there is one."""
        if self._newest is None:
            return "no odometry yet" if not self.refused else "odometry is not finite"
        if self.state(now) is None:
            return f"no fresh transform {self._frame} -> {self._source_frame} on /tf"
        return self.filter.fault(now)

    def local(self, stamp: float, now: float) -> float:
        """Time of a stamp of another sensor on our clock, as the pose's tell it [s]."""
        way = self.filter.shortest_way
        return self._clock.local(stamp, now) + (0.0 if math.isnan(way) else way)


def _with_speeds(before: State | None, here: State) -> State:
    """Speeds of a robot that was elsewhere before."""
    if before is None or not SHORTEST <= here.stamp - before.stamp <= LONGEST:
        return (
            here if before is None else replace(here, v=before.v, omega=before.omega, vy=before.vy)
        )
    seconds = here.stamp - before.stamp
    turn = math.remainder(here.theta - before.theta, math.tau)
    heading = before.theta + turn / 2
    dx, dy = here.x - before.x, here.y - before.y
    cos, sin = math.cos(heading) / seconds, math.sin(heading) / seconds
    return replace(here, v=dx * cos + dy * sin, omega=turn / seconds, vy=dy * cos - dx * sin)
