"""What else sends on the link: other masters are a fault, other stations are told of."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

SET_POINT_MESSAGES = frozenset(
    ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET")
)
WATCHED = frozenset((0, 82, 84, 86))
"""Message ids that are decoded of other systems: HEARTBEAT, and the set-points above."""
MASTER_TOLD = 1.0
"""How long a set-point of another master counts as a fault [s]."""
STATION_TOLD = 5.0
"""How long after its last heartbeat a ground station counts as there [s]."""
GCS = 6
"""MAV_TYPE of a ground station."""


def worth_decoding(system: int, component: int) -> Callable[[int, int, int], bool]:
    """Whether a frame is of our vehicle, or one of the few of others that are looked at."""
    return lambda of, by, kind: (of, by) == (system, component) or kind in WATCHED


class OtherStations:
    """Remembers other stations that were heard.

    It sees only those that the vehicle forwards to our port, or that share it: a master on another
    port of the autopilot stays unseen.

    `vehicle`: system id of the vehicle.
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
