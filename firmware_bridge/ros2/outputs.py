"""Messages that the node publishes: commands, plan, markers, diagnostics."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from firmware_bridge.ros2.message_types import (
    DIAGNOSTICS,
    MARKERS,
    PATH,
    POSE,
    TWIST,
    TWIST_STAMPED,
    MessageTypes,
)
from kmpc_lite.learn.formats.ackermann import ACKERMANN, ACKERMANN_STAMPED

ADD, ARROW, CYLINDER, TEXT = 0, 0, 3, 9
"""Of visualization_msgs/Marker."""
GREEN, BLUE, WHITE = (0.1, 0.7, 0.2, 0.9), (0.1, 0.4, 0.9, 0.6), (1.0, 1.0, 1.0, 0.9)
HEIGHT = 0.2
"""Of markers [m]."""
LIFETIME = 2
"""After which a marker vanishes that is not sent again [s]."""
OK, WARN, ERROR = 0, 1, 2
"""Of diagnostic_msgs/DiagnosticStatus."""
Stamp = tuple[int, int]
"""Seconds and nanoseconds."""


class Outputs:
    """Makes messages.

    Parameters
    ----------
    types : MessageTypes
        Of the distribution.
    frame : str
        Of poses.
    """

    def __init__(self, types: MessageTypes, frame: str) -> None:
        self._types, self._frame = types, frame

    def steered(self, v: float, angle: float, stamp: Stamp, base: str) -> Any:
        """Forward speed [m/s] and steering angle [rad] of a car: AckermannDriveStamped."""
        drive = self._types.make(
            ACKERMANN,
            steering_angle=angle,
            steering_angle_velocity=0.0,
            speed=v,
            acceleration=0.0,
            jerk=0.0,
        )
        return self._types.make(ACKERMANN_STAMPED, header=self._header(stamp, base), drive=drive)

    def command(
        self, v: float, omega: float, stamped: Stamp | None, base: str, vy: float = 0.0
    ) -> Any:
        """Speeds ahead and to the left [m/s] and turn rate [rad/s]; with a stamp, TwistStamped."""
        twist = self._types.make(
            TWIST, linear=self._vector(v, vy, 0.0), angular=self._vector(0.0, 0.0, omega)
        )
        if stamped is None:
            return twist
        return self._types.make(TWIST_STAMPED, header=self._header(stamped, base), twist=twist)

    def path(self, states: NDArray[np.float64], stamp: Stamp) -> Any:
        """States (N + 1, 3) of a plan."""
        header = self._header(stamp, self._frame)
        poses = [self._types.make(POSE, header=header, pose=self._pose(*row)) for row in states]
        return self._types.make(PATH, header=header, poses=poses)

    def markers(
        self,
        robot: tuple[float, float, float],
        radius: float,
        goal: tuple[float, float, float] | None,
        text: str,
        stamp: Stamp,
    ) -> Any:
        """The robot's disc, its goal, and what it is doing, in words."""
        size = (2.0 * radius, 2.0 * radius, HEIGHT)
        found = [
            self._marker(0, CYLINDER, robot, size, BLUE, stamp),
            self._marker(1, TEXT, robot, (0.0, 0.0, HEIGHT), WHITE, stamp, text),
        ]
        if goal is not None:
            arrow = (3.0 * radius, 0.5 * radius, 0.5 * radius)
            found.append(self._marker(2, ARROW, goal, arrow, GREEN, stamp))
        return self._types.make(MARKERS, markers=found)

    def diagnostics(
        self, name: str, level: int, text: str, values: Mapping[str, Any], stamp: Stamp
    ) -> Any:
        """One status with its values."""
        make = self._types.make
        pairs = [
            make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value))
            for key, value in values.items()
        ]
        status = make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=level,
            name=name,
            message=text,
            hardware_id="",
            values=pairs,
        )
        return make(DIAGNOSTICS, header=self._header(stamp, ""), status=[status])

    def _marker(
        self,
        number: int,
        kind: int,
        place: Sequence[float],
        size: tuple[float, float, float],
        colour: tuple[float, float, float, float],
        stamp: Stamp,
        text: str = "",
    ) -> Any:
        make = self._types.make
        no_time = make("builtin_interfaces/msg/Time", sec=0, nanosec=0)
        none = np.zeros(0, dtype=np.uint8)
        return make(
            "visualization_msgs/msg/Marker",
            header=self._header(stamp, self._frame),
            ns="kmpc",
            id=number,
            type=kind,
            action=ADD,
            pose=self._pose(*place),
            scale=self._vector(*size),
            color=self._colour(*colour),
            lifetime=make("builtin_interfaces/msg/Duration", sec=LIFETIME, nanosec=0),
            frame_locked=False,
            points=[],
            colors=[],
            texture_resource="",
            texture=make(
                "sensor_msgs/msg/CompressedImage",
                header=make("std_msgs/msg/Header", stamp=no_time, frame_id=""),
                format="",
                data=none,
            ),
            uv_coordinates=[],
            text=text,
            mesh_resource="",
            mesh_file=make("visualization_msgs/msg/MeshFile", filename="", data=none),
            mesh_use_embedded_materials=False,
        )

    def _header(self, stamp: Stamp, frame: str) -> Any:
        make = self._types.make
        time = make("builtin_interfaces/msg/Time", sec=stamp[0], nanosec=stamp[1])
        return make("std_msgs/msg/Header", stamp=time, frame_id=frame)

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self._types.make("geometry_msgs/msg/Vector3", x=x, y=y, z=z)

    def _colour(self, r: float, g: float, b: float, a: float) -> Any:
        return self._types.make("std_msgs/msg/ColorRGBA", r=r, g=g, b=b, a=a)

    def _pose(self, x: float, y: float, theta: float) -> Any:
        make = self._types.make
        point = make("geometry_msgs/msg/Point", x=float(x), y=float(y), z=0.0)
        half = 0.5 * float(theta)
        turn = make(
            "geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half)
        )
        return make("geometry_msgs/msg/Pose", position=point, orientation=turn)
