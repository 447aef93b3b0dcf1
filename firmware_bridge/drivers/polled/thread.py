"""The thread that asks a board, sends it the newest command, and sets it up anew.

Questions and answers share one serial line, one at a time.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import ClassVar

from firmware_bridge.drivers.motor_board import MotorBoard
from firmware_bridge.drivers.polled.options import PolledOptions
from firmware_bridge.drivers.polled.wheel_checks import DeadWheels, RunawayWheels
from firmware_bridge.kinematics import CarGeometry, Geometry
from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError, State
from firmware_bridge.odometry import Steering, WheelOdometry

STRANGERS, STRANGERS_WITHIN = 5, 1.0
"""This many unsolicited replies within this many seconds: another program talks to the
board. A reply that comes after its time-out is none of them, if it comes within this time."""
MOST_LATE = 100  # questions given up whose replies may still come: more than there are in that time
SETTLE = 0.012
"""Silence after a reply that did not come: past the 10 ms after which a RoboClaw forgets half a
packet [s]."""
SILENCE = 0.5  # a board that has answered nothing for so long is set up anew [s]
ZEROS = 3  # how often a zero is repeated to a board that does not answer commands
JUMP_SHOWN = 1.0  # how long a jump of the counters makes the pose count as untrue [s]
ABSURD = 5.0  # speeds beyond this multiple of the limit are refused


class BoardPose:
    """Newest state from counters and speeds of all channels.

    `geometry`: of the robot. `odometry`: fits the board's counters.
    """

    def __init__(self, geometry: Geometry, odometry: WheelOdometry) -> None:
        self._geometry, self._odometry = geometry, odometry
        self._jumped = self._restarted = -math.inf
        self.state: State | None = None  # newest state; None before the first counters

    @property
    def stamp(self) -> float:
        """When the newest state was measured [s]; minus infinity before the first."""
        return self.state.stamp if self.state is not None else -math.inf

    def jumped(self, now: float) -> bool:
        """Whether the counters have jumped lately."""
        return now - self._jumped < JUMP_SHOWN

    def restarted(self, now: float) -> bool:
        """Whether the board was restarted lately."""
        return now - self._restarted < JUMP_SHOWN

    @property
    def beginnings(self) -> int:
        """How often the counters themselves showed that the board was restarted."""
        return self._odometry.beginnings

    def rebase(self, now: float) -> None:
        """Go on from new counters: the distance rolled meanwhile is unknown."""
        self._odometry.rebase()
        self._jumped = now

    def note_restart(self, now: float) -> None:
        """Remember that the board was restarted."""
        self._restarted = now

    def plausible(self, counts: tuple[float, ...], speeds: tuple[float, ...]) -> bool:
        """Whether wheels can do that: counts, and speeds [motor turns/s]."""
        fastest = (ABSURD * self._geometry.max_wheel_speed + 1.0) / self._geometry.wheel_radius
        finite = all(map(math.isfinite, counts))
        return finite and all(abs(w) <= fastest for w in self._geometry.from_channels(*speeds))

    def move(
        self, counts: tuple[float, ...], speeds: tuple[float, ...], stamp: float, curvature: float
    ) -> bool:
        """Take counts and speeds [motor turns/s] in; False, without a move, where they jumped.

        A car drives in a curvature [1/m].
        """
        if not self._odometry.update(counts, stamp, speeds, curvature):
            self._jumped = stamp
            return False
        v, omega, vy = self._geometry.body(self._geometry.from_channels(*speeds), curvature)
        odometry = self._odometry
        self.state = State(odometry.x, odometry.y, odometry.theta, v, omega, stamp, vy)
        return True


class NoReply(Exception):
    """A reply that did not come in time, or made no sense."""


class Exchange:
    """Asks in one thread, takes replies from another.

    `transport`: the line. `reply_timeout`: how long a reply may take [s]. `begin`: prepares the
    decoder for the reply to a key.
    """

    def __init__(
        self, transport: Transport, reply_timeout: float, begin: Callable[[Hashable], None]
    ) -> None:
        self._transport, self._reply_timeout, self._begin = transport, reply_timeout, begin
        self.changed = threading.Condition()
        """Held while reading or writing shared data; notified of replies."""
        self.closing = False
        self.expected: Hashable = None  # key of the reply that is waited for
        self.heard = -math.inf  # when the board last answered [s]
        self._reply: tuple[bytes, float] | None = None
        self._strangers: list[float] = []
        self._given_up: deque[float] = deque(maxlen=MOST_LATE)
        self.counters = dict.fromkeys(
            ("frames", "timeouts", "unexpected_replies", "refused_replies"), 0
        )

    def ask(self, frame: bytes, key: Hashable) -> tuple[bytes, float]:
        """Send a question and wait; returns its reply and the best estimate of its moment [s]."""
        with self.changed:
            self._begin(key)
            self.expected, self._reply = key, None
            sent = time.monotonic()
            if not self._transport.write(frame):
                self.expected = None
                raise NoReply
            self.changed.wait_for(
                lambda: self._reply is not None or self.closing, self._reply_timeout
            )
            self.expected = None
            if self._reply is None:
                self.counters["timeouts"] += not self.closing
                self._given_up.append(sent)
                raise NoReply
            reply, received = self._reply
            self.heard = received
            self.counters["frames"] += 1
        return reply, (sent + received) / 2.0

    def deliver(self, key: Hashable, reply: bytes, stamp: float) -> None:
        """Hand a reply to the question that waits for it; any other is refused and counted."""
        with self.changed:
            if key is not None and key == self.expected and self._reply is None:
                self._reply = (reply, stamp)
                self.changed.notify_all()
                return
            self.counters["unexpected_replies"] += 1
            if not self._is_late(stamp):
                self._strangers = [*self._strangers[1 - STRANGERS :], stamp]

    def _is_late(self, stamp: float) -> bool:
        """Whether a reply may be to a question of ours that was given up: each has one."""
        while self._given_up:
            if stamp - self._given_up.popleft() < STRANGERS_WITHIN:
                return True
        return False

    def refuse(self, why: str) -> NoReply:
        """Count a reply that came for the right question and makes no sense."""
        self.counters["refused_replies"] += 1
        return NoReply(why)

    def strangers(self, now: float) -> bool:
        """Whether another program must be asking: many replies are unsolicited."""
        return len(self._strangers) == STRANGERS and now - self._strangers[0] < STRANGERS_WITHIN

    def wait(self, done: Callable[[], bool], seconds: float) -> None:
        """Wait until `done`, or the end of the driver."""
        if seconds > 0.0:
            with self.changed:
                self.changed.wait_for(lambda: self.closing or done(), seconds)


@dataclass
class HeldCommand:
    """Speeds of all channels; the driver's lock is held around every call."""

    timeout: float  # a command that is older is replaced by zero [s]
    repeats: int  # how often a zero is repeated
    value: tuple[float, ...]  # [motor turns/s]
    stamp: float = -math.inf  # when it came, on the monotonic clock [s]
    pending: bool = False  # whether it is still to be sent
    zeros: int = 0  # how many repetitions of a zero are left

    def put(self, value: tuple[float, ...], now: float) -> None:
        """Take a new command [motor turns/s]."""
        self.value, self.stamp = value, now
        self.pending, self.zeros = True, self.repeats

    def repeat_zero(self) -> None:
        """Send a zero once more, where it may have been lost."""
        if self.zeros and not any(self.value):
            self.zeros -= 1
            self.pending = True

    def withdraw_old(self, now: float) -> bool:
        """Replace a command that has become old by zero; True if that was needed."""
        if not any(self.value) or now - self.stamp <= self.timeout:
            return False
        self.value, self.pending, self.zeros = (0.0,) * len(self.value), True, self.repeats
        return True

    def stands(self, now: float) -> bool:
        """Whether a standstill is requested now, or nothing yet."""
        never = self.stamp == -math.inf
        return not any(self.value) and (never or now - self.stamp < self.timeout)


class Board(MotorBoard):
    """The questions and commands of one kind of board.

    They run in the driver's thread, but `_feed`, which runs in the transport's.
    """

    options_type: ClassVar[type[PolledOptions]]
    hint = "is it powered and wired, TX to RX?"
    answers_commands = True
    """Whether the board answers commands; they then wait for the reply that is under way, and are
    repeated until answered. Else they go out at once, and zeros a few times more."""

    def _configure(self) -> None:
        """Find the board, stop it, set and check its watchdog; raises NoReply or LinkError."""
        raise NotImplementedError

    def _poll(self, cycle: int) -> None:
        """Ask for counters, speeds and errors once; calls `_moved`."""
        raise NotImplementedError

    def _drive(self, *speeds: float) -> None:
        """Send the speeds of all channels, in motor turns per second."""
        raise NotImplementedError

    def _release(self) -> None:
        """Let go of the motors, which stand still."""

    def _arm(self) -> None:
        """Take the motors, at zero speed; raises NoReply, or LinkError where the board refuses."""

    def _barrier(self) -> None:
        """Ask what `_poll` never asks first: late replies come before it and are thrown away."""

    def _feed(self, data: bytes, stamp: float) -> None:
        """Take bytes off the link; calls `_exchange.deliver` for each frame."""
        raise NotImplementedError

    def _begin(self, key: Hashable) -> None:
        """Prepare the decoder for the reply to `key`."""

    def _damaged(self) -> int:
        """Bytes that the decoder had to skip."""
        return 0


class PollingThread(Board):
    """Asks for counters and errors round by round; a command goes out in between.

    A last guard replaces a command that has become old by zero.

    `transport`, `geometry`, `odometry`, `options`: as `PolledDriver` takes them.
    """

    def __init__(
        self,
        transport: Transport,
        geometry: Geometry,
        odometry: WheelOdometry,
        options: PolledOptions,
    ) -> None:
        self._transport, self._geometry = transport, geometry
        self._pose = BoardPose(geometry, odometry)
        self._odometry, self._dead = (
            odometry,
            DeadWheels(geometry.names, geometry.wheel_radius, odometry.count),
        )
        self._runaway = RunawayWheels(
            geometry.names, geometry.max_wheel_speed / geometry.wheel_radius
        )
        self._steering = Steering(geometry) if isinstance(geometry, CarGeometry) else None
        self._period = 1.0 / options.poll_hz
        repeats = 0 if self.answers_commands else ZEROS
        self._held = HeldCommand(options.command_timeout, repeats, geometry.still)
        self._exchange = Exchange(transport, options.reply_timeout, self._begin)
        self._changed = self._exchange.changed
        self._thread: threading.Thread | None = None
        self._configured = False
        self._released = False
        self._armed = True
        self._late = False
        self._errors: tuple[str, ...] = ()
        self._warnings: tuple[str, ...] = ()
        self._trouble: tuple[str, ...] = ()
        self._estimate_ok = True
        self._mode = ""
        self._links = 0
        names = (
            "refused_commands",
            "stale_commands",
            "odometry_jumps",
            "setups",
            "board_restarts",
            "driver_errors",
        )
        self._counters = dict.fromkeys(names, 0)

    def _run(self) -> None:
        deadline, cycle = time.monotonic(), 0
        while not self._exchange.closing:
            try:
                if not self._transport.connected:
                    self._configured = False
                    self._exchange.wait(lambda: False, 0.05)
                    continue
                self._notice_loss()
                self._guard()  # before all else: a zero goes out even if no reply ever comes back
                self._set_up()
                now = time.monotonic()
                if now >= deadline:
                    deadline = max(deadline + self._period, now)  # no burst after a stall
                    self._round(cycle)
                    cycle += 1
                self._exchange.wait(lambda: self._held.pending, deadline - time.monotonic())
            except NoReply:
                self._late = True
                self._settle()
            except LinkError as error:  # the board answers, and does not do what it should
                self._trouble = (str(error),)
                self._exchange.wait(lambda: False, 0.05)
            except Exception as error:  # nothing that a board says may end this thread
                self._counters["driver_errors"] += 1
                self._trouble = (f"{type(error).__name__}: {error}",)
                self._configured = False
                self._exchange.wait(lambda: False, 0.05)
        for last_word in (self._halt, self._release) if self._released else (self._halt,):
            try:
                last_word()
            except NoReply:
                pass  # it is written; the reply is not awaited

    def _halt(self) -> None:
        self._drive(*self._geometry.still)

    def _round(self, cycle: int) -> None:
        """Ask once, repeat a zero that may be lost, and take back motors that the board let go."""
        if self._late:
            self._barrier()
            self._late = False
        with self._changed:
            self._held.repeat_zero()
        self._send_pending()
        self._poll(cycle)
        still = self._held.stands(time.monotonic())
        if not self._armed and not self._released and still and cycle % 5 == 0:
            self._arm()  # only while a standstill is requested
            self._trouble = ()

    def _notice_loss(self) -> None:
        """See whether the board must be set up again: link lost, or long without an answer."""
        links = self._transport.counters["reconnects"]
        if links != self._links or time.monotonic() - self._exchange.heard > SILENCE:
            self._configured, self._links = False, links

    def _set_up(self) -> None:
        if self._configured:
            return
        self._configure()
        with self._changed:
            self._configured = True
            self._counters["setups"] += 1
            self._trouble = ()
            self._exchange.heard = time.monotonic()

    def _send_pending(self) -> None:
        """Send the newest command, if it has not been."""
        # held while a frame is queued, so that two threads cannot swap a command and a zero
        with self._changed:
            if not self._held.pending:
                return
            self._held.pending = False
            speeds = self._held.value
            if any(speeds) and (self._released or not self._armed or not self._configured):
                self._counters["refused_commands"] += 1
                speeds = self._geometry.still
            try:
                self._drive(*speeds)
                if self._released:
                    self._release()
            except NoReply:
                # perhaps it was not heard: questions feed the board's watchdog, so say it again
                self._held.pending = True
                raise

    def _guard(self) -> None:
        """Replace a command that has become old by zero.

        Asking alone keeps some boards' watchdogs fed.
        """
        with self._changed:
            if self._held.withdraw_old(time.monotonic()):
                self._counters["stale_commands"] += 1
        self._send_pending()

    def _ask(self, frame: bytes, key: Hashable) -> tuple[bytes, float]:
        """Ask a question, after a command that came meanwhile; returns reply and stamp [s]."""
        reply = self._exchange.ask(frame, key)
        self._send_pending()
        return reply

    def _restarted(self) -> None:
        """Note that the board was switched off and on.

        Its counters begin anew, and the distance rolled is unknown.
        """
        with self._changed:
            self._pose.rebase(time.monotonic())
            self._note_restart()

    def _note_restart(self) -> None:
        """Tell of it, and set the board up anew; one restart may show in several ways."""
        self._pose.note_restart(time.monotonic())
        self._counters["board_restarts"] += self._configured
        self._configured = False

    def _moved(self, counts: tuple[float, ...], speeds: tuple[float, ...], stamp: float) -> None:
        """Take counters and speeds (motor turns per second) of all channels into the odometry."""
        if not self._pose.plausible(counts, speeds):
            raise self._exchange.refuse(f"counters {counts}, speeds {speeds}")
        with self._changed:
            beginnings = self._pose.beginnings
            curvature = 0.0 if self._steering is None else self._steering.at(stamp)
            if not self._pose.move(counts, speeds, stamp, curvature):
                self._counters["odometry_jumps"] += 1
                if self._pose.beginnings != beginnings:
                    self._note_restart()
                return
            self._watch_wheels(speeds, stamp)
            self._changed.notify_all()

    def _watch_wheels(self, speeds: tuple[float, ...], stamp: float) -> None:
        """See whether the wheels follow their commands; motors that are off need not."""
        if self._released or self._errors or not (self._armed and self._configured):
            self._dead.forget()
            self._runaway.forget()
            return
        asked = self._geometry.from_channels(*self._held.value)
        self._dead.take(asked, self._odometry.turned, stamp)
        self._runaway.take(asked, self._geometry.from_channels(*speeds), stamp)

    def _settle(self) -> None:
        """Let what is late arrive and be thrown away before the next request."""
        self._exchange.wait(lambda: False, SETTLE)
