"""Which end controls the robot: the bridge takes control when asked, never from a pilot.

To give it back, HOLD is asked for until the vehicle confirms it. Other masters on the link are a
fault, other stations are told of. ArduPilot's GCS failsafe is the vehicle's own watchdog on the
bridge: off by default, it watches the heartbeats of one system id only.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import Enum
from typing import Any

from firmware_bridge.drivers.mavlink.commands import (
    ACCEPTED,
    ARM,
    DENIED,
    SET_MODE,
    UNSUPPORTED,
    CommandDesk,
)

MODES = {
    0: "MANUAL",
    1: "ACRO",
    3: "STEERING",
    4: "HOLD",
    5: "LOITER",
    6: "FOLLOW",
    7: "SIMPLE",
    8: "DOCK",
    9: "CIRCLE",
    10: "AUTO",
    11: "RTL",
    12: "SMART_RTL",
    15: "GUIDED",
    16: "INITIALISING",
}
"""Custom modes of ArduPilot Rover."""
HOLD, GUIDED = 4, 15
PILOT = 0.5
"""A failsafe's text and the HOLD that it chooses come within this time [s]: a HOLD without such a
text was chosen by a pilot."""
NOT_READY = "waiting until the vehicle accepts our frames and knows where it is"
OVERRULED = (
    "the autopilot's failsafe chose HOLD before anything was driven: waiting until it clears"
)
CUSTOM_MODE_ENABLED = 1  # flag of DO_SET_MODE
HEARTBEAT_LOST = 2.5
"""Silence after which the mode is not known any more [s]: of HEARTBEATs at the protocol's 1 Hz, one
may be lost and the next be late."""
ENABLE, WATCHED = "FS_GCS_ENABLE", "SYSID_MYGCS"
PERIOD, TRIES = 1.0, 6  # until the second request [s], then twice as long each time; and how many
SET_POINT_MESSAGES = frozenset(
    ("SET_POSITION_TARGET_LOCAL_NED", "SET_POSITION_TARGET_GLOBAL_INT", "SET_ATTITUDE_TARGET")
)
HEARD = frozenset((0, 82, 84, 86))
"""Message ids that are decoded of other systems: HEARTBEAT, and the set-points above."""
MASTER_TOLD = 1.0  # how long a set-point of another master counts as a fault [s]
STATION_TOLD = 5.0  # how long after its last heartbeat a ground station counts as there [s]
GCS = 6  # MAV_TYPE of a ground station


class Aim(Enum):
    """What the bridge wants of the vehicle now."""

    WATCH = "the robot is whose it is"
    TAKE = "asking for GUIDED, then for arming"
    RELEASE = "asking for HOLD"


class Authority:
    """Follows the vehicle's mode and arming, and asks for changes of them.

    `desk`: sends the commands. `able`: whether the vehicle accepts our frames and knows where it is
    at a time [s]: what is asked before is undone by its boot, and by the mode switch, read then.
    """

    def __init__(self, desk: CommandDesk, able: Callable[[float], bool]) -> None:
        self._desk, self._able = desk, able
        self.aim = Aim.WATCH
        self.mode: int | None = None
        self.armed = False
        self.heard = -float("inf")
        self.refusal = ""
        """Why the vehicle refuses to be controlled, in words; empty if it does not, or was not
        asked."""
        self.yielded = 0
        """How often a pilot or station changed mode or arming while we had the robot."""
        self.overruled = 0
        """How often the autopilot's own failsafe chose HOLD before anything was driven."""
        self._asked = self._guided_seen = self._untouched = False
        self._failsafe = self._lost = -float("inf")

    @property
    def mode_name(self) -> str:
        """Name of the mode, empty before the first heartbeat."""
        return "" if self.mode is None else MODES.get(self.mode, f"mode {self.mode}")

    @property
    def obeys(self) -> bool:
        """Whether the vehicle said that it obeys set-points: armed, GUIDED, and taken."""
        return self.armed and self.mode == GUIDED and self.aim is not Aim.TAKE

    def fresh(self, now: float) -> bool:
        """Whether its last HEARTBEAT is young enough for that to count."""
        return now - self.heard < HEARTBEAT_LOST

    def take(self, now: float) -> None:
        """Ask for GUIDED and arming, as soon as the vehicle is able."""
        self.aim, self.refusal = Aim.TAKE, NOT_READY
        self._asked, self._guided_seen, self._untouched = False, False, True
        self._lost = -float("inf")
        self._desk.cancel(SET_MODE)
        self._desk.cancel(ARM)

    def drove(self) -> None:
        """Note that the robot was commanded to move: any HOLD from now on is meant to stop it."""
        self._untouched = False

    def on_failsafe(self, now: float) -> None:
        """Note that the autopilot reports a failsafe of its own."""
        self._failsafe = now
        if self.aim is Aim.WATCH and self._untouched and now - self._lost < PILOT:
            self._take_again()

    def release(self, now: float) -> None:
        """Ask for HOLD, if the robot is ours or about to be."""
        if self.aim is Aim.RELEASE:
            return
        taking, self._untouched = self.aim is Aim.TAKE, False
        self._desk.cancel(ARM)
        self._desk.cancel(SET_MODE)
        if taking or self.mode == GUIDED:
            self.aim = Aim.RELEASE
            self._guided_seen = not taking or self._guided_seen
            self._desk.request(SET_MODE, CUSTOM_MODE_ENABLED, HOLD, now=now, patient=True)

    def on_heartbeat(self, mode: int, armed: bool, now: float) -> None:
        """Take mode and arming from a HEARTBEAT."""
        ours = self.mode == GUIDED and self.armed and self.aim is Aim.WATCH
        self.mode, self.armed, self.heard = mode, armed, now
        if ours and not (mode == GUIDED and armed):
            self.yielded += 1
            self._lost = now
            if self._untouched and mode == HOLD and now - self._failsafe < PILOT:
                self._take_again()
        if armed and mode == GUIDED:
            self.refusal = ""
        self.tick(now)

    def tick(self, now: float) -> None:
        """Take the next step towards the aim."""
        if self.aim is Aim.TAKE:
            if not self._asked:
                self._begin(now)
            else:
                self._take(now)
        elif self.aim is Aim.RELEASE:
            agreed = self._desk.result(SET_MODE) == ACCEPTED and self.mode == HOLD
            # a pilot who leaves GUIDED while we request HOLD keeps the chosen mode
            if agreed or (self._guided_seen and self.mode not in (GUIDED, HOLD)):
                self._finish()

    def _begin(self, now: float) -> None:
        """Ask for GUIDED once the vehicle is able, and no failsafe would take it back."""
        if now - self._failsafe >= PILOT and self._able(now):
            self._asked, self.refusal = True, ""
            self._desk.request(SET_MODE, CUSTOM_MODE_ENABLED, GUIDED, now=now, patient=True)

    def _take(self, now: float) -> None:
        mode, arm = self._desk.result(SET_MODE), self._desk.result(ARM)
        if mode in (DENIED, UNSUPPORTED) or arm in (DENIED, UNSUPPORTED):
            self.refusal = "the vehicle refuses " + (
                "GUIDED" if mode in (DENIED, UNSUPPORTED) else "to arm"
            )
            self._finish()
        elif self._guided_seen and self.mode != GUIDED:
            self._taken_back(now)
        elif mode == ACCEPTED and self.mode == GUIDED and not self._guided_seen:
            self._guided_seen, self.refusal = True, ""
            self._desk.cancel(SET_MODE)
            self._desk.request(ARM, 1.0, now=now, patient=True)
        elif arm == ACCEPTED and self.armed:
            self._finish()
        elif mode is not None and mode != ACCEPTED:
            self.refusal = "GUIDED is refused for now"
        elif arm is not None and arm != ACCEPTED:
            self.refusal = "arming is refused for now"

    def _taken_back(self, now: float) -> None:
        """React to a vehicle that left GUIDED while we armed it: by its failsafe, or by a pilot."""
        if self._lost == -float("inf"):
            self._lost = now
        if self.mode == HOLD and now - self._failsafe < PILOT:
            self._take_again()
        elif self.mode != HOLD or now - self._lost >= PILOT:
            self.yielded += 1
            self.refusal = f"mode changed to {self.mode_name} by somebody else while we armed"
            self._finish()

    def _take_again(self) -> None:
        """Ask anew once the failsafe, which waited for a heartbeat of ours, has cleared."""
        self.overruled += 1
        self._asked = self._guided_seen = False
        self.aim, self.refusal, self._lost = Aim.TAKE, OVERRULED, -float("inf")
        self._desk.cancel(SET_MODE)
        self._desk.cancel(ARM)

    def _finish(self) -> None:
        self.aim = Aim.WATCH
        self._desk.cancel(SET_MODE)
        self._desk.cancel(ARM)


class GcsFailsafe:
    """Reads the two parameters and turns the failsafe on.

    `read`: sends PARAM_REQUEST_READ for a name. `write`: sends PARAM_SET: name, value, type.
    `own_system`: our system id. `wanted`: whether to turn it on, or only to look.
    """

    def __init__(
        self,
        read: Callable[[str], None],
        write: Callable[[str, float, int], None],
        own_system: int,
        wanted: bool,
    ) -> None:
        self._read, self._write = read, write
        self._own_system, self._wanted = own_system, wanted
        self._values: dict[str, tuple[float, int]] = {}
        self._due, self._tries = -float("inf"), 0

    def on_param(self, name: str, value: float, kind: int, now: float) -> None:
        """Take a PARAM_VALUE."""
        if name in (ENABLE, WATCHED):
            self._values[name] = (value, kind)
            if name == ENABLE and value == 0.0 and self._wanted:
                self._due = min(self._due, now)

    def tick(self, now: float) -> None:
        """Ask for what is missing."""
        if now < self._due or self._tries >= TRIES or self.settled:
            return
        self._due, self._tries = now + PERIOD * 2.0**self._tries, self._tries + 1
        for name in (ENABLE, WATCHED):
            if name not in self._values:
                self._read(name)
        enable = self._values.get(ENABLE)
        if enable is not None and enable[0] == 0.0 and self._wanted:
            self._write(ENABLE, 1.0, enable[1])

    @property
    def watched(self) -> int | None:
        """System id whose heartbeats it counts, None if that is not known."""
        return round(self._values[WATCHED][0]) if WATCHED in self._values else None

    @property
    def settled(self) -> bool:
        """Whether nothing is left to ask."""
        known = len(self._values) == 2
        return known and (not self._wanted or self._values[ENABLE][0] != 0.0)

    @property
    def note(self) -> str:
        """Whether the vehicle watches our heartbeats, in words."""
        if ENABLE not in self._values or WATCHED not in self._values:
            return f"GCS failsafe: {ENABLE} and {WATCHED} not read" + (
                ": no answer" if self._tries >= TRIES else " yet"
            )
        if self._values[ENABLE][0] == 0.0:
            return (
                f"GCS failsafe: off ({ENABLE} 0): if this computer dies, "
                "only the 3 s set-point time-out stops the rover"
            )
        watched = round(self._values[WATCHED][0])
        if watched != self._own_system:
            return (
                f"GCS failsafe: watches system {watched} ({WATCHED}), not us ({self._own_system})"
            )
        return "GCS failsafe: on, watches us"


def worth_decoding(system: int, component: int) -> Callable[[int, int, int], bool]:
    """Whether a frame is of our vehicle, or one of the few of others that are looked at."""
    return lambda of, by, kind: (of, by) == (system, component) or kind in HEARD


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
