"""What the emulated rover sends, and how often: one builder a message, intervals as requested."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.frames import enu_to_ned
from kmpc_lab.emulator.rover.autopilot import GUIDED, HOLD, LOITER, Autopilot
from kmpc_lab.emulator.rover.estimator import ORIGIN

METRES_PER_DEGREE = 111320.0
MILLISECONDS_WRAP = 2**32
CAPABILITIES = (
    dialect.MAV_PROTOCOL_CAPABILITY_PARAM_FLOAT
    | dialect.MAV_PROTOCOL_CAPABILITY_COMMAND_INT
    | dialect.MAV_PROTOCOL_CAPABILITY_SET_POSITION_TARGET_LOCAL_NED
    | dialect.MAV_PROTOCOL_CAPABILITY_MAVLINK2
)
FIRMWARE = 4 << 24 | 6 << 16 | 3 << 8 | 255  # 4.6.3, an official release
SENSORS = (
    dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
    | dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
    | dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS
    | dialect.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
)
GROUPS = {1: (24,), 2: (1, 2), 3: (65,), 4: (36,), 6: (32, 33), 10: (30,), 11: (74,), 12: (193, 2)}
"""REQUEST_DATA_STREAM groups -> message ids."""
SHARE = 0.8  # part of the main loop's rate that telemetry may come at: 40 Hz of 50, more is denied


class Telemetry:
    """Builds messages and knows which are due.

    `autopilot`: what to tell of.
    """

    def __init__(self, autopilot: Autopilot) -> None:
        self._pilot = autopilot
        self._intervals: dict[int, float] = {}
        self._due: dict[int, float] = {}
        self._builders: dict[int, Callable[[], Any]] = {
            0: self.heartbeat,
            1: self._sys_status,
            2: lambda: dialect.MAVLink_system_time_message(0, self.boot_ms),
            24: self._gps,
            30: self._attitude,
            32: self._local_position,
            33: self._global_position,
            36: lambda: dialect.MAVLink_servo_output_raw_message(
                self._micros % 2**32, 0, *self._servos, *[0] * 4
            ),
            49: self._origin,
            65: lambda: dialect.MAVLink_rc_channels_message(self.boot_ms, 0, *[65535] * 18, 255),
            74: self._hud,
            148: self._version,
            193: self._ekf,
            242: self._home,
        }
        self.set_interval(0, 1.0)

    @property
    def boot_ms(self) -> int:
        """`time_boot_ms`, which wraps."""
        return int(self._pilot.uptime * 1000.0) % MILLISECONDS_WRAP

    @property
    def shortest(self) -> float:
        """Shortest interval that is granted [s]."""
        return 1.0 / (SHARE * self._pilot.parameters["SCHED_LOOP_RATE"])

    def knows(self, message: int) -> bool:
        """Whether a message of this id is emulated."""
        return message in self._builders

    def interval(self, message: int) -> float:
        """Interval of a message [s]; 0 if it is not sent."""
        return self._intervals.get(message, 0.0)

    def set_interval(self, message: int, interval: float) -> None:
        """Send a message every `interval` [s] from now on; 0 stops it."""
        self._intervals.pop(message, None)
        if interval > 0.0:
            self._intervals[message] = max(interval, self.shortest)
            self._due[message] = self._pilot.uptime

    def set_group(self, group: int, rate: float) -> None:
        """Obey REQUEST_DATA_STREAM: messages of a group at a rate [Hz]; 0 stops, group 0 is all."""
        ids = (
            {i for ids in GROUPS.values() for i in ids}
            if group == 0
            else set(GROUPS.get(group, ()))
        )
        for message in ids:
            self.set_interval(message, 0.0 if rate <= 0.0 else 1.0 / rate)

    def due(self) -> list[Any]:
        """Messages to send now."""
        now, messages = self._pilot.uptime, []
        for message, interval in self._intervals.items():
            if now >= self._due[message] - 1e-6:
                # after a stall the missed ones are left out
                self._due[message] = max(self._due[message] + interval, now)
                messages.append(self.build(message))
        return [message for message in messages if message is not None]

    def build(self, message: int) -> Any:
        """One message, None if there is nothing to tell (yet)."""
        return self._builders[message]()

    def heartbeat(self) -> Any:
        """Mode and arming."""
        pilot = self._pilot
        base = dialect.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED
        base |= dialect.MAV_MODE_FLAG_SAFETY_ARMED if pilot.armed else 0
        base |= (
            dialect.MAV_MODE_FLAG_GUIDED_ENABLED
            if pilot.mode in (GUIDED, LOITER)
            else dialect.MAV_MODE_FLAG_MANUAL_INPUT_ENABLED
        )
        state = (
            dialect.MAV_STATE_CRITICAL
            if pilot.failsafe
            else dialect.MAV_STATE_STANDBY
            if pilot.mode == HOLD
            else dialect.MAV_STATE_ACTIVE
        )
        return dialect.MAVLink_heartbeat_message(
            dialect.MAV_TYPE_GROUND_ROVER,
            dialect.MAV_AUTOPILOT_ARDUPILOTMEGA,
            base,
            pilot.mode,
            state,
            3,
        )

    @property
    def _micros(self) -> int:
        return int(self._pilot.uptime * 1e6)

    @property
    def _ned(self) -> tuple[float, float, float, float, float, float]:
        """North, east [m], yaw [rad], their rates."""
        north, east, yaw = enu_to_ned(*self._pilot.estimator.pose)
        v_east, v_north, turn = self._pilot.physics.velocity
        turned = self._pilot.estimator.pose[2] - self._pilot.physics.pose[2]
        cos, sin = math.cos(turned), math.sin(turned)
        return north, east, yaw, v_east * sin + v_north * cos, v_east * cos - v_north * sin, -turn

    @property
    def _place(self) -> tuple[int, int, int]:
        """Latitude, longitude [1e-7 deg], altitude [mm]."""
        latitude, longitude, altitude = self._pilot.estimator.origin or ORIGIN
        north, east, *_ = self._ned
        degrees = (
            latitude + north / METRES_PER_DEGREE,
            longitude + east / (METRES_PER_DEGREE * math.cos(math.radians(latitude))),
        )
        return round(degrees[0] * 1e7), round(degrees[1] * 1e7), round(altitude * 1e3)

    @property
    def _servos(self) -> tuple[int, int, int, int]:
        """Steering on 1, throttle on 3 [us]."""
        v_east, v_north, turn = self._pilot.physics.velocity
        speed = math.hypot(v_east, v_north) / max(self._pilot.parameters["CRUISE_SPEED"], 0.1)
        return (
            1500 - round(200 * max(-2.0, min(2.0, turn))),
            0,
            1500 + round(400 * min(1.0, speed)),
            0,
        )

    def _sys_status(self) -> Any:
        ready = 0 if self._pilot.prearm_failure else dialect.MAV_SYS_STATUS_PREARM_CHECK
        located = dialect.MAV_SYS_STATUS_AHRS if self._pilot.estimator.position_ok else 0
        present = SENSORS | dialect.MAV_SYS_STATUS_AHRS | dialect.MAV_SYS_STATUS_PREARM_CHECK
        return dialect.MAVLink_sys_status_message(
            present, present, SENSORS | located | ready, 300, 12600, 500, 100, *[0] * 6
        )

    def _gps(self) -> Any:
        latitude, longitude, altitude = self._place
        fix = 6 if self._pilot.estimator.origin and not self._pilot.parameters.motion_capture else 1
        return dialect.MAVLink_gps_raw_int_message(
            self._micros, fix, latitude, longitude, altitude, 121, 200, 0, 65535, 10
        )

    def _attitude(self) -> Any:
        _, _, yaw, _, _, rate = self._ned
        return dialect.MAVLink_attitude_message(self.boot_ms, 0.0, 0.0, yaw, 0.0, 0.0, rate)

    def _local_position(self) -> Any:
        if not self._pilot.estimator.position_ok:
            return None
        north, east, _, v_north, v_east, _ = self._ned
        return dialect.MAVLink_local_position_ned_message(
            self.boot_ms, north, east, 0.0, v_north, v_east, 0.0
        )

    def _global_position(self) -> Any:
        latitude, longitude, altitude = self._place
        _, _, yaw, v_north, v_east, _ = self._ned
        heading = round(math.degrees(yaw) * 100.0) % 36000
        return dialect.MAVLink_global_position_int_message(
            self.boot_ms,
            latitude,
            longitude,
            altitude,
            0,
            round(v_north * 100.0),
            round(v_east * 100.0),
            0,
            heading,
        )

    def _origin(self) -> Any:
        if self._pilot.estimator.origin is None:
            return None
        latitude, longitude, altitude = self._pilot.estimator.origin
        return dialect.MAVLink_gps_global_origin_message(
            round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
        )

    def _home(self) -> Any:
        if self._pilot.estimator.origin is None:
            return None
        latitude, longitude, altitude = self._pilot.estimator.origin
        place = round(latitude * 1e7), round(longitude * 1e7), round(altitude * 1e3)
        return dialect.MAVLink_home_position_message(
            *place, 0.0, 0.0, 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0
        )

    def _hud(self) -> Any:
        _, _, yaw, v_north, v_east, _ = self._ned
        speed = math.hypot(v_north, v_east)
        return dialect.MAVLink_vfr_hud_message(
            speed, speed, round(math.degrees(yaw)) % 360, 0, self._place[2] / 1e3, 0.0
        )

    def _ekf(self) -> Any:
        bad = 0.0 if self._pilot.estimator.position_ok else 1.0
        return dialect.MAVLink_ekf_status_report_message(
            self._pilot.estimator.flags, 0.02, 0.02 + bad, 0.02, 0.02, 0.0
        )

    def _version(self) -> Any:
        return dialect.MAVLink_autopilot_version_message(
            CAPABILITIES, FIRMWARE, 0, 0, 0, tuple(b"emulated"), (0,) * 8, (0,) * 8, 0, 0, 0
        )
