"""The messages that we send, built in one place."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.options import GCS, MavlinkOptions
from firmware_bridge.frames import enu_to_ned

BODY_NED = 8
VELOCITY_AND_YAW_RATE = 0x5C7
"""Type mask: position, acceleration and yaw ignored; with one of vx, vy ignored as well ArduPilot
would drop both."""
MONOTONIC_MS = 2**32


class MessageBuilder:
    """Messages to one vehicle.

    `options`: ids of the vehicle, and ours.
    """

    def __init__(self, options: MavlinkOptions) -> None:
        self._to = (options.system, options.component)
        self._type = (
            dialect.MAV_TYPE_GCS if options.role == GCS else dialect.MAV_TYPE_ONBOARD_CONTROLLER
        )

    def heartbeat(self) -> Any:
        """HEARTBEAT of ours."""
        return dialect.MAVLink_heartbeat_message(
            self._type, dialect.MAV_AUTOPILOT_INVALID, 0, 0, dialect.MAV_STATE_ACTIVE, 3
        )

    def set_point(self, v: float, omega: float, now: float) -> Any:
        """Speed along the nose [m/s] and turn rate, counter-clockwise [rad/s], both finite.

        A NaN speed makes ArduPilot abort; here is the last check against one.
        """
        if not (math.isfinite(v) and math.isfinite(omega)):
            raise ValueError(
                f"expected a finite speed and turn rate, got {v!r} m/s, {omega!r} rad/s"
            )
        boot_ms = int(now * 1000.0) % MONOTONIC_MS
        rest = (0.0,) * 6
        return dialect.MAVLink_set_position_target_local_ned_message(
            boot_ms,
            *self._to,
            BODY_NED,
            VELOCITY_AND_YAW_RATE,
            0.0,
            0.0,
            0.0,
            float(v),
            *rest,
            0.0 - float(omega),
        )

    def command(self, command: int, parameters: Sequence[float], confirmation: int) -> Any:
        """COMMAND_LONG; missing parameters are 0."""
        values = [float(p) for p in parameters] + [0.0] * (7 - len(parameters))
        return dialect.MAVLink_command_long_message(*self._to, command, confirmation, *values)

    def timesync(self, tc1: int, ts1: int) -> Any:
        """A request where tc1 is 0, else the reply to one [ns]."""
        return dialect.MAVLink_timesync_message(tc1, ts1)

    def vision(self, x: float, y: float, theta: float, stamp: float) -> Any:
        """A pose of ours (ENU) at our time as VISION_POSITION_ESTIMATE, level and at height 0."""
        north, east, yaw = enu_to_ned(x, y, theta)
        return dialect.MAVLink_vision_position_estimate_message(
            int(stamp * 1e6), north, east, 0.0, 0.0, 0.0, yaw
        )

    def origin(self, latitude: float, longitude: float, altitude: float) -> Any:
        """SET_GPS_GLOBAL_ORIGIN [deg, deg, m]."""
        place = round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
        return dialect.MAVLink_set_gps_global_origin_message(self._to[0], *place)

    def parameter_read(self, name: str) -> Any:
        """PARAM_REQUEST_READ by name."""
        return dialect.MAVLink_param_request_read_message(*self._to, name.encode(), -1)

    def parameter_set(self, name: str, value: float, kind: int) -> Any:
        """PARAM_SET."""
        return dialect.MAVLink_param_set_message(*self._to, name.encode(), value, kind)
