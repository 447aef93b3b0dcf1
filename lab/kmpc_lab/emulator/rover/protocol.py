"""How the emulated rover answers messages: commands, parameters, time, missions."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.commands import (
    ACCEPTED,
    DENIED,
    FAILED,
    TEMPORARILY_REJECTED,
    UNSUPPORTED,
)
from firmware_bridge.frames import ned_to_enu
from kmpc_lab.emulator.rover.autopilot import WARNING, Autopilot
from kmpc_lab.emulator.rover.telemetry import Telemetry

FORCE_ARM = 21196
CUSTOM_MODE_ENABLED = 1
STICK = 1000.0
PWM_CENTRE, PWM_SPAN = 1500.0, 500.0
MISSION_UNSUPPORTED, MISSION_ACCEPTED = 3, 0
FTP_NAK, FTP_UNKNOWN_COMMAND = 129, 7


class Protocol:
    """Answers messages.

    `autopilot`: obeys. `telemetry`: tells. `send`: takes a message to put on the wire. `system`:
    the vehicle's id. `set_up_signing`: takes a signing key and a time stamp [10 us].
    """

    def __init__(
        self,
        autopilot: Autopilot,
        telemetry: Telemetry,
        send: Callable[[Any], None],
        system: int,
        set_up_signing: Callable[[bytes, int], None],
    ) -> None:
        self._pilot, self._telemetry, self._send, self._system = autopilot, telemetry, send, system
        self._set_up_signing = set_up_signing
        self.ignored = 0  # messages of kinds that are not emulated
        self.reboot = False  # set where a reboot was asked for and granted
        self._next_parameter: int | None = None
        self._handlers: dict[str, Callable[[Any], None]] = {
            "HEARTBEAT": self._heartbeat,
            "COMMAND_LONG": lambda m: self._command(
                m, (m.param1, m.param2, m.param3, m.param4, m.param5, m.param6, m.param7)
            ),
            "COMMAND_INT": lambda m: self._command(
                m, (m.param1, m.param2, m.param3, m.param4, float(m.x), float(m.y), m.z)
            ),
            "SET_MODE": self._set_mode,
            "SET_POSITION_TARGET_LOCAL_NED": self._set_point,
            "VISION_POSITION_ESTIMATE": self._vision,
            "SET_GPS_GLOBAL_ORIGIN": self._set_origin,
            "TIMESYNC": self._timesync,
            "REQUEST_DATA_STREAM": lambda m: self._telemetry.set_group(
                m.req_stream_id, m.req_message_rate if m.start_stop else 0.0
            ),
            "PARAM_REQUEST_LIST": self._list_parameters,
            "PARAM_REQUEST_READ": self._read_parameter,
            "PARAM_SET": self._write_parameter,
            "MANUAL_CONTROL": lambda m: self._pilot.pilot(m.z / STICK, m.y / STICK),
            "RC_CHANNELS_OVERRIDE": self._override,
            "MISSION_REQUEST_LIST": lambda m: self._to_sender(
                m, dialect.MAVLink_mission_count_message, 0, m.mission_type
            ),
            "MISSION_CLEAR_ALL": lambda m: self._to_sender(
                m, dialect.MAVLink_mission_ack_message, MISSION_ACCEPTED, m.mission_type
            ),
            "MISSION_COUNT": lambda m: self._to_sender(
                m, dialect.MAVLink_mission_ack_message, MISSION_UNSUPPORTED, m.mission_type
            ),
            "SETUP_SIGNING": self._signing,
            "FILE_TRANSFER_PROTOCOL": self._refuse_file_transfer,
        }

    def on_message(self, message: Any) -> None:
        """Take one message that is not for somebody else."""
        if getattr(message, "target_system", 0) not in (0, self._system) or getattr(
            message, "target_component", 0
        ) not in (0, 1):
            return
        handler = self._handlers.get(message.get_type())
        if handler is None:
            self.ignored += 1
        else:
            handler(message)

    def step(self) -> None:
        """Send the next parameter of a list that was asked for."""
        if self._next_parameter is not None:
            self._tell_parameter(self._pilot.parameters.names[self._next_parameter])
            self._next_parameter += 1
            if self._next_parameter >= len(self._pilot.parameters.names):
                self._next_parameter = None

    def _heartbeat(self, message: Any) -> None:
        if message.type == dialect.MAV_TYPE_GCS:
            self._pilot.heard_gcs(message.get_srcSystem())

    def _command(self, message: Any, p: tuple[float, ...]) -> None:
        result = self._obey(message.command, p)
        ack = dialect.MAVLink_command_ack_message(
            message.command, result, 0, 0, message.get_srcSystem(), message.get_srcComponent()
        )
        self._send(ack)
        if (
            message.command
            in (dialect.MAV_CMD_REQUEST_MESSAGE, dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES)
            and result == ACCEPTED
        ):
            self._send(
                self._telemetry.build(
                    int(p[0]) if message.command == dialect.MAV_CMD_REQUEST_MESSAGE else 148
                )
            )

    def _obey(self, command: int, p: tuple[float, ...]) -> int:
        """Carry out a command; its MAV_RESULT."""
        pilot, telemetry = self._pilot, self._telemetry
        if not all(map(math.isfinite, p[:2])):
            return DENIED
        if command == dialect.MAV_CMD_DO_SET_MODE:
            return self._change_mode(int(p[0]), int(p[1]))
        if command == dialect.MAV_CMD_COMPONENT_ARM_DISARM:
            if p[0] == 1.0:
                return ACCEPTED if pilot.arm(force=p[1] == FORCE_ARM) else FAILED
            if p[0] == 0.0:
                pilot.disarm()
                return ACCEPTED
        elif command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL:
            return self._set_interval(int(p[0]), p[1])
        elif command == dialect.MAV_CMD_GET_MESSAGE_INTERVAL and telemetry.knows(int(p[0])):
            interval = telemetry.interval(int(p[0]))
            self._send(
                dialect.MAVLink_message_interval_message(int(p[0]), round(interval * 1e6) or -1)
            )
            return ACCEPTED
        elif command == dialect.MAV_CMD_REQUEST_MESSAGE:
            known = telemetry.knows(int(p[0])) and telemetry.build(int(p[0])) is not None
            return ACCEPTED if known else FAILED
        elif command == dialect.MAV_CMD_REQUEST_AUTOPILOT_CAPABILITIES:
            return ACCEPTED
        elif command == dialect.MAV_CMD_RUN_PREARM_CHECKS:
            return ACCEPTED if pilot.tell_prearm() else TEMPORARILY_REJECTED
        elif command == dialect.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN and p[0] == 1.0:
            self.reboot = not pilot.armed
            return FAILED if pilot.armed else ACCEPTED
        return UNSUPPORTED

    def _change_mode(self, base: int, custom: int) -> int:
        if not base & CUSTOM_MODE_ENABLED:
            return UNSUPPORTED
        return ACCEPTED if self._pilot.set_mode(custom) else FAILED

    def _set_interval(self, message: int, microseconds: float) -> int:
        if not self._telemetry.knows(message):
            return FAILED
        # whole milliseconds, as the real one counts them
        interval = (
            max(1, int(microseconds) // 1000) / 1000.0
            if microseconds > 0.0
            else 1.0
            if microseconds == 0.0 and message == 0
            else 0.0
        )
        if 0.0 < interval < self._telemetry.shortest - 1e-6:
            return DENIED
        self._telemetry.set_interval(message, interval)
        return ACCEPTED

    def _set_mode(self, message: Any) -> None:
        result = self._change_mode(message.base_mode, message.custom_mode)
        self._send(dialect.MAVLink_command_ack_message(dialect.MAVLINK_MSG_ID_SET_MODE, result))

    def _set_point(self, m: Any) -> None:
        self._pilot.set_point(m.coordinate_frame, m.type_mask, (m.vx, m.vy), m.yaw, m.yaw_rate)

    def _vision(self, m: Any) -> None:
        self._pilot.estimator.vision(*ned_to_enu(m.x, m.y, m.yaw), self._pilot.uptime)

    def _set_origin(self, m: Any) -> None:
        estimator = self._pilot.estimator
        if estimator.origin is None:
            estimator.origin = (m.latitude * 1e-7, m.longitude * 1e-7, m.altitude * 1e-3)
            self._send(self._telemetry.build(49))

    def _signing(self, m: Any) -> None:
        """As the real one: not while armed, and without a word where it works."""
        if self._pilot.armed:
            self._pilot.say(WARNING, "ERROR: Won't setup signing when armed")
        else:
            self._set_up_signing(bytes(m.secret_key), m.initial_timestamp)

    def _timesync(self, m: Any) -> None:
        if m.tc1 == 0:
            self._send(
                dialect.MAVLink_timesync_message(
                    int(self._pilot.uptime * 1e9) + self._system, m.ts1
                )
            )

    def _list_parameters(self, _message: Any) -> None:
        self._next_parameter = 0

    def _read_parameter(self, m: Any) -> None:
        names = self._pilot.parameters.names
        if 0 <= m.param_index < len(names):
            self._tell_parameter(names[m.param_index])
        elif m.param_index < 0 and m.param_id in self._pilot.parameters:
            self._tell_parameter(m.param_id)

    def _write_parameter(self, m: Any) -> None:
        self._pilot.parameters.set(m.param_id, m.param_value)
        if m.param_id in self._pilot.parameters:
            self._tell_parameter(m.param_id)

    def _tell_parameter(self, name: str) -> None:
        p = self._pilot.parameters
        self._send(
            dialect.MAVLink_param_value_message(
                name.encode(), p[name], p.kind(name), len(p.names), p.names.index(name)
            )
        )

    def _override(self, m: Any) -> None:
        if 0 < m.chan1_raw < 65535 and 0 < m.chan3_raw < 65535:
            self._pilot.pilot(
                (m.chan3_raw - PWM_CENTRE) / PWM_SPAN, (m.chan1_raw - PWM_CENTRE) / PWM_SPAN
            )

    def _to_sender(
        self, message: Any, kind: Callable[..., Any], value: int, mission_type: int
    ) -> None:
        self._send(kind(message.get_srcSystem(), message.get_srcComponent(), value, mission_type))

    def _refuse_file_transfer(self, m: Any) -> None:
        """Answer NAK, unknown command, with the next sequence number and the asked opcode."""
        asked = bytes(m.payload)
        sequence = (int.from_bytes(asked[:2], "little") + 1) % 2**16
        header = (
            sequence.to_bytes(2, "little")
            + bytes((asked[2], FTP_NAK, 1, asked[3], 0, 0))
            + bytes(4)
        )
        payload = (header + bytes((FTP_UNKNOWN_COMMAND,))).ljust(len(asked), b"\0")
        self._send(
            dialect.MAVLink_file_transfer_protocol_message(
                0, m.get_srcSystem(), m.get_srcComponent(), tuple(payload)
            )
        )
