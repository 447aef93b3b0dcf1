"""What else sends on the link, and what ground stations may send to a vehicle that is driven.

Other masters are a fault. A station's frame passes as it came, with its ids, sequence number and
signature, or not at all.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import HEADER, MavlinkCodec, origin

SET_POINT_MESSAGES = frozenset(
    ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET")
)
WATCHED = frozenset((0, 82, 84, 86))
"""Message ids that are decoded of other systems: HEARTBEAT, and the set-points above."""
SECTORS = frozenset((132, 330))
"""Message ids that any component of the vehicle may send: DISTANCE_SENSOR, OBSTACLE_DISTANCE."""
MASTER_TOLD = 1.0
"""How long a set-point of another master counts as a fault [s]."""
STATION_TOLD = 5.0
"""How long after its last heartbeat a ground station counts as there [s]."""
GCS = 6
"""MAV_TYPE of a ground station."""


def worth_decoding(
    system: int, component: int, sectors: bool = False
) -> Callable[[int, int, int], bool]:
    """Whether a frame is of our vehicle, or one of the few of others that are looked at."""
    around = SECTORS if sectors else frozenset()
    return lambda of, by, kind: (
        (of, by) == (system, component) or kind in WATCHED or (of == system and kind in around)
    )


class OtherStations:
    """Remembers other stations that were heard.

    It sees only those that the vehicle forwards to our port, or that share it: a master on another
    port of the autopilot stays unseen.

    Parameters
    ----------
    vehicle : int
        System id of the vehicle.
    """

    def __init__(self, vehicle: int) -> None:
        self._vehicle = vehicle
        self._master, self._master_stamp = 0, -math.inf
        self._stations: dict[int, float] = {}
        self.counters = {"others": 0, "other_masters": 0}

    def saw(self, message: Any, now: float) -> None:
        """Take a message of a station that is not our vehicle."""
        self.counters["others"] += 1
        kind, system = message.get_type(), message.get_srcSystem()
        if kind in SET_POINT_MESSAGES and message.target_system in (0, self._vehicle):
            self.counters["other_masters"] += 1
            self._master, self._master_stamp = system, now
        elif kind == "HEARTBEAT" and message.type == GCS:
            self._stations[system] = now

    def faults(self, now: float) -> tuple[str, ...]:
        """Masters, in words."""
        if now - self._master_stamp >= MASTER_TOLD:
            return ()
        return (f"another master: system {self._master} sends set-points to the vehicle",)

    def notes(self, now: float, watched: int | None) -> tuple[str, ...]:
        """Stations, in words; `watched` is whose heartbeats the vehicle's failsafe counts."""
        return tuple(
            f"another ground station is on the link: system {system}"
            + (
                ", whose heartbeats the GCS failsafe counts as ours: after the death of this "
                "computer only the 3 s set-point time-out stops the rover"
                if system == watched
                else ""
            )
            for system, stamp in sorted(self._stations.items())
            if now - stamp < STATION_TOLD
        )


SET_POINTS = {
    dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED,
    dialect.MAVLINK_MSG_ID_SET_POSITION_TARGET_GLOBAL_INT,
    dialect.MAVLINK_MSG_ID_SET_ATTITUDE_TARGET,
    dialect.MAVLINK_MSG_ID_SET_ACTUATOR_CONTROL_TARGET,
}
"""They act in GUIDED alone, which is ours: never passed on."""
STEERING = {
    dialect.MAVLINK_MSG_ID_MANUAL_CONTROL,
    dialect.MAVLINK_MSG_ID_RC_CHANNELS_OVERRIDE,
}
"""A pilot's, after a mode change."""
PLACES = {
    dialect.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN,
    dialect.MAVLINK_MSG_ID_SET_HOME_POSITION,
    dialect.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE,
    dialect.MAVLINK_MSG_ID_GLOBAL_VISION_POSITION_ESTIMATE,
    dialect.MAVLINK_MSG_ID_VISION_SPEED_ESTIMATE,
    dialect.MAVLINK_MSG_ID_VICON_POSITION_ESTIMATE,
    dialect.MAVLINK_MSG_ID_ATT_POS_MOCAP,
    dialect.MAVLINK_MSG_ID_ODOMETRY,
    dialect.MAVLINK_MSG_ID_GPS_INPUT,
    dialect.MAVLINK_MSG_ID_HIL_GPS,
    dialect.MAVLINK_MSG_ID_HIL_STATE,
    dialect.MAVLINK_MSG_ID_HIL_STATE_QUATERNION,
}
"""They would shift the map under a robot that drives."""
KEYS = {dialect.MAVLINK_MSG_ID_SETUP_SIGNING}
COMMANDS = {dialect.MAVLINK_MSG_ID_COMMAND_LONG, dialect.MAVLINK_MSG_ID_COMMAND_INT}
ITEMS = {dialect.MAVLINK_MSG_ID_MISSION_ITEM, dialect.MAVLINK_MSG_ID_MISSION_ITEM_INT}
STREAMS = dialect.MAVLINK_MSG_ID_REQUEST_DATA_STREAM
MOVES = {
    dialect.MAV_CMD_NAV_WAYPOINT,
    dialect.MAV_CMD_DO_ORBIT,
    dialect.MAV_CMD_CONDITION_YAW,
    dialect.MAV_CMD_DO_CHANGE_SPEED,
    dialect.MAV_CMD_DO_SET_HOME,
    dialect.MAV_CMD_DO_SET_SERVO,
    dialect.MAV_CMD_DO_REPOSITION,
    dialect.MAV_CMD_DO_SET_REVERSE,
    dialect.MAV_CMD_DO_MOTOR_TEST,
    dialect.MAV_CMD_NAV_SET_YAW_SPEED,
    dialect.MAV_CMD_GUIDED_CHANGE_SPEED,
    dialect.MAV_CMD_GUIDED_CHANGE_ALTITUDE,
    dialect.MAV_CMD_GUIDED_CHANGE_HEADING,
}
"""Commands that move a vehicle in GUIDED, change how it moves, or shift its map."""
OUR_STREAMS = {0, 30, 32, 49, 193}
"""Messages that a drive needs at their rate (`streams.py`) ..."""
OUR_GROUPS = {0, 6, 10, 12}
"""... and groups of REQUEST_DATA_STREAM that contain them."""
COMMAND_AT, CURRENT_AT, GROUP_AT = 28, 35, 4
"""Where these stand in the payload of COMMAND_LONG and COMMAND_INT, MISSION_ITEM and
MISSION_ITEM_INT, and REQUEST_DATA_STREAM."""
GUIDED_NOW, LONGEST = (2, 3), 255
"""Mission items that are not for a mission, but to be driven to at once."""


class StationRules:
    """Judges what a station sends.

    Parameters
    ----------
    vehicle : tuple of int
        System and component of the vehicle.
    holds : callable
        Whether the bridge drives it now.
    """

    def __init__(self, vehicle: tuple[int, int], holds: Callable[[], bool]) -> None:
        self._vehicle, self._holds = vehicle, holds
        # as the vehicle itself: MAVProxy shows no other texts
        self._says = MavlinkCodec(*vehicle)

    def cut(self) -> Callable[[bytes, float], Iterator[bytes]]:
        """Make what cuts the bytes of one station into whole frames."""
        codec = MavlinkCodec(*self._vehicle)
        return lambda data, now: (bytes(frame) for frame in codec.frames(data, now))

    def judge(self, frame: bytes) -> str:
        """Say why a frame must not pass; empty if it may."""
        system, component, kind = origin(frame)
        name = dialect.mavlink_map[kind].msgname
        if (system, component) == self._vehicle:
            return f"{name} in the vehicle's own name"
        if kind in SET_POINTS or kind in KEYS:
            return f"{name} of system {system}: only the bridge sends these"
        if self._holds() and (what := _steers(kind, _payload(frame))):
            return f"{what} of system {system}: the bridge drives; choose a mode first"
        return ""

    def tell(self, text: str) -> bytes:
        """Frame a text that a station shows to its user."""
        severity = dialect.MAV_SEVERITY_WARNING
        message = dialect.MAVLink_statustext_message(severity, text.encode()[:50])
        return self._says.encode(message)


def _payload(frame: bytes) -> bytes:
    """Payload of a frame; version 2 leaves zeros at its end out."""
    head = HEADER[frame[0]]
    return frame[head : head + frame[1]].ljust(LONGEST, b"\0")


def _steers(kind: int, payload: bytes) -> str:
    """Name a message that must not reach a vehicle that we drive; empty for any other."""
    name = dialect.mavlink_map[kind].msgname
    if kind in STEERING or kind in PLACES:
        return str(name)
    if kind in COMMANDS:
        (command,) = struct.unpack_from("<H", payload, COMMAND_AT)
        (first,) = struct.unpack_from("<f", payload)
        lowers = command == dialect.MAV_CMD_SET_MESSAGE_INTERVAL and first in OUR_STREAMS
        return f"{name} {command}" if command in MOVES or lowers else ""
    if kind in ITEMS and payload[CURRENT_AT] in GUIDED_NOW:
        return f"{name} to be driven at once"
    if kind == STREAMS and payload[GROUP_AT] in OUR_GROUPS:
        return f"{name} {payload[GROUP_AT]}"
    return ""
