"""Messages of an emulated robot: odometry, transforms, scan, map, clock."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from firmware_bridge.ros2.message_types import CLOCK, GRID, ODOMETRY, POSE, SCAN, TF, MessageTypes
from kmpc_lab.emulator.ros2.world import CellMap
from kmpc_lite.types import Array

Pose = Sequence[float]
"""x, y [m], theta [rad]."""


class RobotMessages:
    """Makes them; times are of the robot's own clock [s]."""

    def __init__(self, types: MessageTypes) -> None:
        self.types = types

    def odometry(self, pose: Pose, speeds: Pose, time: float, frame: str, base: str) -> Any:
        """Pose in `frame`, forward speed [m/s], turn rate [rad/s], and an omni's to the left."""
        make, none = self.types.make, np.zeros(36)
        v, omega, vy = (*speeds, 0.0)[:3]
        twist = make(
            "geometry_msgs/msg/Twist",
            linear=self._vector(v, vy, 0.0),
            angular=self._vector(0.0, 0.0, omega),
        )
        return make(
            ODOMETRY,
            header=self.header(time, frame),
            child_frame_id=base,
            pose=make(
                "geometry_msgs/msg/PoseWithCovariance", pose=self._pose(pose), covariance=none
            ),
            twist=make("geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=none),
        )

    def transforms(self, *links: tuple[str, str, Pose], time: float) -> Any:
        """Parent, child, and where the child lies in the parent."""
        make = self.types.make
        return make(
            TF,
            transforms=[
                make(
                    "geometry_msgs/msg/TransformStamped",
                    header=self.header(time, parent),
                    child_frame_id=child,
                    transform=make(
                        "geometry_msgs/msg/Transform",
                        translation=self._vector(pose[0], pose[1], 0.0),
                        rotation=self._turn(pose[2]),
                    ),
                )
                for parent, child, pose in links
            ],
        )

    def goal(self, pose: Pose, time: float, frame: str) -> Any:
        """A goal, as RViz sends it."""
        return self.types.make(POSE, header=self.header(time, frame), pose=self._pose(pose))

    def scan(self, ranges: Array, farthest: float, time: float, frame: str) -> Any:
        """Beams all around, the first one backwards."""
        return self.types.make(
            SCAN,
            header=self.header(time, frame),
            angle_min=-math.pi,
            angle_max=math.pi,
            angle_increment=2.0 * math.pi / len(ranges),
            time_increment=0.0,
            scan_time=0.0,
            range_min=0.01,
            range_max=farthest,
            ranges=ranges.astype(np.float32),
            intensities=np.zeros(0, dtype=np.float32),
        )

    def map(self, cells: CellMap, time: float, frame: str) -> Any:
        """The whole map."""
        height, width = cells.cells.shape
        header = self.header(time, frame)
        info = self.types.make(
            "nav_msgs/msg/MapMetaData",
            map_load_time=header.stamp,
            resolution=cells.resolution,
            width=width,
            height=height,
            origin=self._pose((*cells.origin, 0.0)),
        )
        return self.types.make(GRID, header=header, info=info, data=cells.cells.reshape(-1))

    def clock(self, time: float) -> Any:
        """Simulated time."""
        return self.types.make(CLOCK, clock=self.header(time, "").stamp)

    def header(self, time: float, frame: str) -> Any:
        """A header with its stamp."""
        whole = math.floor(time)
        stamp = self.types.make(
            "builtin_interfaces/msg/Time", sec=whole, nanosec=int((time - whole) * 1e9)
        )
        return self.types.make("std_msgs/msg/Header", stamp=stamp, frame_id=frame)

    def _pose(self, pose: Pose) -> Any:
        point = self.types.make(
            "geometry_msgs/msg/Point", x=float(pose[0]), y=float(pose[1]), z=0.0
        )
        return self.types.make(
            "geometry_msgs/msg/Pose", position=point, orientation=self._turn(pose[2])
        )

    def _turn(self, theta: float) -> Any:
        half = 0.5 * float(theta)
        return self.types.make(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
        )

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self.types.make("geometry_msgs/msg/Vector3", x=float(x), y=float(y), z=float(z))
