"""One MAVLink vehicle, without threads: messages in, messages out, on the times it is given."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from typing import Any

from firmware_bridge.drivers.mavlink.authority import (
    HOLD,
    Aim,
    Authority,
    GcsFailsafe,
    OtherStations,
    worth_decoding,
)
from firmware_bridge.drivers.mavlink.clock import VehicleClock
from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.drivers.mavlink.commands import (
    PREARM_CHECKS,
    CommandDesk,
    Due,
    Greeting,
    MessageBuilder,
)
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.drivers.mavlink.streams import EKF_STATUS, StreamRequests, wanted_streams
from firmware_bridge.drivers.mavlink.telemetry import (
    FrameWatch,
    MocapFeed,
    PoseTracker,
    StatusTexts,
    tells_failsafe,
    vehicle_status,
)
from firmware_bridge.messages import LinkStatus, State

Lock = AbstractContextManager[Any]
NO_LOCK: Lock = nullcontext()
ARDUPILOT, ROVER_TYPES = 3, (10, 11)
"""MAV_AUTOPILOT, and MAV_TYPE of a ground rover and a surface boat."""
ARMED = 128  # flag of HEARTBEAT.base_mode
CRITICAL = 5  # HEARTBEAT.system_status while a failsafe of the autopilot acts
TIMESYNC_PERIOD, ZERO_PERIOD, ORIGIN_PERIOD, ANSWER_PERIOD = 1.0, 0.1, 2.0, 0.05
TIMESYNC_FIRST = 0.1  # between requests until enough were answered [s]


class MavlinkCore:
    """The state of one vehicle, and the messages that are due to it.

    Not thread-safe: `MavlinkDriver` holds one lock around every call but `receive`, which takes it
    for one message at a time.

    `options`: system ids, and what to ask of the vehicle. `write`: takes one whole frame.
    `wall_time`: unix time for signature time stamps [s].
    """

    def __init__(
        self, options: MavlinkOptions, write: Callable[[bytes], object], wall_time: float
    ) -> None:
        self.options, self._write = options, write
        key, self._vehicle = options.read_key(), (options.system, options.component)
        wanted = worth_decoding(*self._vehicle)
        self.codec = MavlinkCodec(*options.us, key=key, wall_time=wall_time, wanted=wanted)
        self._build = MessageBuilder(options)
        self.clock, self.pose = VehicleClock(), PoseTracker()
        self.desk = CommandDesk(
            lambda command, parameters, again: self._send(
                self._build.command(command, parameters, again)
            )
        )
        self.authority = Authority(self.desk, self._able)
        self.streams = StreamRequests(self.desk, wanted_streams(options.rate))
        self.failsafe = GcsFailsafe(
            lambda name: self._send(self._build.parameter_read(name)),
            lambda name, value, kind: self._send(self._build.parameter_set(name, value, kind)),
            options.us[0],
            options.failsafe,
        )
        self.heard, self.wrong_vehicle, self.identified = -math.inf, "", False
        self.status_texts, self.greeting, self.frame = StatusTexts(), Greeting(), FrameWatch()
        self.others = OtherStations(options.system)
        self.mocap = MocapFeed(options, self._build, self._send)
        self._moved = False
        self._handlers: dict[str, Callable[[Any, float], None]] = {
            "HEARTBEAT": self._on_heartbeat,
            "LOCAL_POSITION_NED": lambda m, now: self._on_pose(self.pose.on_position, m, now),
            "ATTITUDE": lambda m, now: self._on_pose(self.pose.on_attitude, m, now),
            "EKF_STATUS_REPORT": lambda m, now: self.pose.on_ekf(m.flags, now),
            "COMMAND_ACK": self._on_ack,
            "TIMESYNC": self._on_timesync,
            "PARAM_VALUE": lambda m, now: self.failsafe.on_param(
                m.param_id, m.param_value, m.param_type, now
            ),
            "STATUSTEXT": self._on_text,
            "GPS_GLOBAL_ORIGIN": self._on_origin,
        }
        self._is_due = Due()
        self._counters = dict.fromkeys(("unmatched_acks", "unmatched_timesync", "held_back"), 0)

    def receive(self, data: bytes, now: float, lock: Lock = NO_LOCK) -> bool:
        """Take bytes from the link; return whether they held a message of the vehicle.

        `lock` is held while a message is taken, not while bytes are searched and decoded: whoever
        commands must not wait for a flood.
        """
        spoke = False
        for message in self.codec.messages(data, now):
            ours = (message.get_srcSystem(), message.get_srcComponent()) == self._vehicle
            spoke = spoke or ours
            with lock:
                (self._on_message if ours else self.others.saw)(message, now)
        return spoke

    def _on_message(self, message: Any, now: float) -> None:
        """Take one message of our vehicle."""
        self.heard = now
        handler = self._handlers.get(message.get_type())
        if handler is not None:
            handler(message, now)
        self.streams.saw(message.get_msgId(), now)

    def _on_heartbeat(self, message: Any, now: float) -> None:
        if (message.autopilot, message.type in ROVER_TYPES) != (ARDUPILOT, True):
            self.wrong_vehicle = (
                f"system {self.options.system} is no ArduPilot rover: "
                f"autopilot {message.autopilot}, type {message.type}"
            )
            return
        self.wrong_vehicle, self.identified = "", True
        armed = bool(message.base_mode & ARMED)
        if armed:
            self.status_texts.on_armed()
        if message.system_status == CRITICAL:
            self.authority.on_failsafe(now)
        self.authority.on_heartbeat(message.custom_mode, armed, now)

    def _on_pose(self, take: Callable[[Any, float], None], message: Any, now: float) -> None:
        take(message, self.clock.stamp(message.time_boot_ms, now))
        self.frame.on_clock(self.clock.resets)

    def _on_ack(self, message: Any, now: float) -> None:
        system, component = self.options.us
        ours = message.target_system in (0, system) and message.target_component in (0, component)
        if ours and self.desk.on_ack(message.command, message.result, now):
            self.greeting.on_answer(now)
        else:
            self._counters["unmatched_acks"] += 1
        self.authority.tick(now)

    def distrust(self, now: float) -> tuple[str, ...]:
        """Why the vehicle's estimate of its pose is not to be trusted."""
        return self.pose.faults(now, self.streams.rate(EKF_STATUS))

    def _able(self, now: float) -> bool:
        return self.greeting.done(now) and not self.distrust(now)

    def _on_timesync(self, message: Any, now: float) -> None:
        if message.tc1 == 0:
            # answered now and then: a flood of questions must not crowd commands out of the link
            if self._is_due("answer", now, ANSWER_PERIOD):
                self._send(self._build.timesync(int(now * 1e9), message.ts1))
        elif self.clock.answer(message.tc1, message.ts1, now):
            self.greeting.on_answer(now)
            self.frame.on_clock(self.clock.resets)
        else:
            self._counters["unmatched_timesync"] += 1

    def _on_text(self, message: Any, now: float) -> None:
        if tells_failsafe(self.status_texts.on_text(message, now)):
            self.authority.on_failsafe(now)

    def _on_origin(self, message: Any, now: float) -> None:
        self.mocap.has_origin = True
        self.frame.on_origin(message.latitude, message.longitude)

    def tick(self, now: float) -> None:
        """Send what is due; to be called 20 times a second."""
        if self._is_due("heartbeat", now, self.greeting.period(now)):
            self._send(self._build.heartbeat())
            self.greeting.on_heartbeat_sent(now)
        self.status_texts.tick(now)
        if not self.identified or self.wrong_vehicle:
            return
        if self._is_due("timesync", now, TIMESYNC_PERIOD if self.clock.settled else TIMESYNC_FIRST):
            self._send(self._build.timesync(0, self.clock.ask(now)))
        self.streams.tick(now)
        self.failsafe.tick(now)
        if self.mocap.wants_origin and self.pose.state is None:
            if self._is_due("origin", now, ORIGIN_PERIOD):
                self.mocap.send_origin()
        self.desk.tick(now)
        self.authority.tick(now)
        if self.authority.aim is Aim.RELEASE and self._is_due("zero", now, ZERO_PERIOD):
            self._send(self._build.set_point(0.0, 0.0, now))

    def set_point(self, v: float, omega: float, now: float) -> None:
        """Command a velocity: zeros are always sent, others only to a vehicle that we control.

        A vehicle that is being given back is not controlled by us any more.
        """
        message = self._build.set_point(v, omega, now)
        moving = v != 0.0 or omega != 0.0
        if moving and not (
            self.authority.obeys and self.authority.aim is Aim.WATCH and not self.wrong_vehicle
        ):
            self._counters["held_back"] += 1
            return
        if moving:
            self._moved = True
            self.authority.drove()
        self._send(message)

    def take(self, now: float) -> None:
        """Begin to ask for GUIDED and arming."""
        self.authority.take(now)

    def confirm_frame(self) -> None:
        """Trust the vehicle's frame again, after it was checked on the map."""
        self.frame.confirm()

    def ask_prearm(self, now: float) -> None:
        """Ask the autopilot to say what keeps it from arming."""
        self.desk.request(PREARM_CHECKS, now=now)

    def stop(self, now: float) -> None:
        """Send zeros, then HOLD, until HOLD is confirmed; a pilot's mode is left alone."""
        self._moved = False
        self._send(self._build.set_point(0.0, 0.0, now))
        self.authority.release(now)

    @property
    def stopping(self) -> bool:
        """Whether HOLD is asked for and not confirmed."""
        return self.authority.aim is Aim.RELEASE

    @property
    def owes_stop(self) -> bool:
        """Whether the vehicle may still be moving on our command."""
        return self._moved and self.authority.mode != HOLD

    def feed_pose(self, x: float, y: float, theta: float, stamp: float, now: float) -> None:
        """Pass a pose from outside on; bad ones are refused and counted."""
        self.mocap.feed(x, y, theta, stamp, now)

    @property
    def state(self) -> State | None:
        """Newest state."""
        return self.pose.state

    def status(self, now: float, connected: bool) -> LinkStatus:
        """What is known of the vehicle."""
        return vehicle_status(self, now, connected)

    def notes(self, now: float) -> tuple[str, ...]:
        """Remarks for the user that stop no robot."""
        return (
            self.failsafe.note,
            *self.others.notes(now, self.failsafe.watched),
            *self.streams.notes(now),
            *(text for _, text in self.status_texts.texts),
        )

    def warnings(self, now: float) -> tuple[str, ...]:
        """What a user should know while the robot drives."""
        return tuple(filter(None, (self.streams.warning(now),)))

    def refusals(self, now: float) -> tuple[str, ...]:
        """Why the autopilot would not arm, in its own words."""
        return self.status_texts.refusals(now)

    @property
    def counters(self) -> dict[str, int]:
        """Everything that is counted."""
        more = {
            "refused_telemetry": self.pose.refused,
            "unpaired_positions": self.pose.unpaired,
            "clock_jumps": self.clock.jumps,
            "yielded": self.authority.yielded,
            "overruled": self.authority.overruled,
            "streams_lowered": self.streams.lowered,
            "refused_poses": self.mocap.refused,
            "frame_doubts": self.frame.doubts,
        }
        counters = {**self.codec.counters, **self._counters, **self.others.counters, **more}
        counters["others"] += counters.pop("passed_over")
        return counters

    def _send(self, message: Any) -> None:
        self._write(self.codec.encode(message))
