"""What the serial motor controllers share: a thread that asks, odometry, health, a last guard.

The guard replaces a command that has become old by zero.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Hashable

from firmware_bridge.drivers.exchange import Exchange, NoReply
from firmware_bridge.kinematics import WheelGeometry, WheelOdometry
from firmware_bridge.link import Transport
from firmware_bridge.messages import LinkError, LinkStatus, State

SETTLE = 0.012
"""Silence after a reply that did not come: past the 10 ms after which a RoboClaw forgets half a
packet [s]."""
SILENCE = 0.5
"""A board that has answered nothing for so long is set up anew [s]."""
JUMP_SHOWN = 1.0
"""How long a jump of the counters makes the pose count as untrue [s]."""
ZEROS = 3
"""How often a zero is repeated to a board that does not answer commands."""
ABSURD = 5.0
"""Speeds past so many times the limit are refused."""


class PolledDriver:
    """A `Driver` that asks a board for its counters, one request under way at a time.

    A subclass builds the frames: `_configure`, `_poll`, `_drive`, `_release`, `_feed`. They run in
    the driver's thread, but `_feed`, which runs in the transport's.

    Parameters
    ----------
    transport : Transport
        Not yet started; the driver starts and closes it.
    geometry : WheelGeometry
        Of the robot.
    odometry : WheelOdometry
        Fits the board's counters.
    poll_hz : float
        Rounds of questions per second [Hz].
    reply_timeout : float
        How long a reply may take [s].
    command_timeout : float
        The driver itself sends zero speed when the last command is older [s].
    """

    board = "board"
    hint = "is it powered and wired, TX to RX?"
    answers_commands = True
    """Whether the board answers commands; they then wait for the reply that is under way, and are
    repeated until answered.  Else they go out at once, and zeros a few times more. """

    def __init__(
        self,
        transport: Transport,
        geometry: WheelGeometry,
        odometry: WheelOdometry,
        poll_hz: float,
        reply_timeout: float,
        command_timeout: float,
    ) -> None:
        self._transport, self._geometry, self._odometry = transport, geometry, odometry
        self._period, self._command_timeout = 1.0 / poll_hz, command_timeout
        self._exchange = Exchange(transport, reply_timeout, self._begin)
        self._changed = self._exchange.changed
        self._thread: threading.Thread | None = None
        self._configured = False
        self._released = False
        self._armed = True
        self._command = (0.0, 0.0)
        self._command_stamp = -math.inf
        self._pending = self._late = False
        self._zeros = 0
        self._jumped = -math.inf
        self._state: State | None = None
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

    # What a board adds

    def _configure(self) -> None:
        """Find the board, stop it, set and check its watchdog; raises NoReply or LinkError."""
        raise NotImplementedError

    def _poll(self, cycle: int) -> None:
        """Ask for counters, speeds and errors once; calls `_moved`."""
        raise NotImplementedError

    def _drive(self, first: float, second: float) -> None:
        """Send the speeds of both channels, in motor turns per second."""
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

    # Driver protocol

    def connect(self, timeout: float) -> None:
        """Open the link, set the board up and wait for its first counters."""
        try:
            self._transport.start(self._feed)
        except LinkError:
            self.close()
            raise
        self._thread = threading.Thread(
            target=self._run, name=f"bridge-{self.board.lower()}", daemon=True
        )
        self._thread.start()
        with self._changed:
            done = self._changed.wait_for(
                lambda: self._configured and self._armed and self._state is not None, timeout
            )
        if not done:
            reason = self._why_silent(timeout)
            self.close()
            raise LinkError(reason)

    def state(self) -> State | None:
        """Newest odometry."""
        return self._state

    def send(self, v: float, omega: float) -> None:
        """Command speeds: written at once, or after the reply that is under way."""
        left, right = self._geometry.wheels(v, omega)
        with self._changed:
            self._command, self._command_stamp = (
                self._geometry.to_channels(left, right),
                time.monotonic(),
            )
            self._pending, self._zeros = True, self._repeats()
            if left == right == 0.0:
                self._released = False  # only standing still may take the motors back
            if not self.answers_commands:
                self._send_pending()
            self._changed.notify_all()

    def stop(self) -> None:
        """Zero speed, then release the motors; the next zero command takes them back."""
        with self._changed:
            self._command, self._command_stamp = (0.0, 0.0), time.monotonic()
            self._pending, self._zeros = True, self._repeats()
            self._released = True
            if not self.answers_commands:
                self._send_pending()
            self._changed.notify_all()

    def health(self) -> LinkStatus:
        """What is known of the board."""
        now = time.monotonic()
        with self._changed:
            jumped = now - self._jumped < JUMP_SHOWN
            faults = self._errors + self._trouble
            if jumped:
                faults += (
                    "the wheel counters jumped: the board was restarted, or a reply was damaged",
                )
            if self._exchange.strangers(now):
                faults += (
                    "replies that nobody asked for: does another program talk to the board?",
                )
            fresh = now - self._exchange.heard < SILENCE
            connected = self._transport.connected
            if not connected and self._transport.last_error:
                faults += (self._transport.last_error,)
            return LinkStatus(
                connected=connected,
                heartbeat_stamp=self._exchange.heard,
                pose_stamp=self._state.stamp if self._state is not None else -math.inf,
                ready=connected
                and self._configured
                and fresh
                and self._armed
                and not self._errors
                and not self._released,
                pose_ok=self._estimate_ok and not jumped,
                armed=self._armed and not self._released,
                mode="; ".join((*filter(None, (self._mode,)), *self._warnings)),
                faults=faults,
                counters={
                    **self._transport.counters,
                    **self._exchange.counters,
                    **self._counters,
                    "bad_bytes": self._damaged(),
                },
            )

    def close(self) -> None:
        """Zero speed as the last word, then close the link."""
        with self._changed:
            if self._exchange.closing:
                return
            self._exchange.closing = True
            self._changed.notify_all()
        if self._thread is not None and self._thread is not threading.current_thread():
            self._thread.join()
        self._transport.close()

    # Thread of the driver

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
                    deadline = max(
                        deadline + self._period, now
                    )  # after a stall, skip: do not burst
                    self._round(cycle)
                    cycle += 1
                self._exchange.wait(lambda: self._pending, deadline - time.monotonic())
            except NoReply:
                self._late = True
                self._settle()
            except LinkError as error:  # the board answers, and does not do what it should
                self._trouble = (str(error),)
                self._exchange.wait(lambda: False, 0.05)
            except (
                Exception
            ) as error:  # nothing that a board says may end this thread: it is counted and told
                self._counters["driver_errors"] += 1
                self._trouble = (f"{type(error).__name__}: {error}",)
                self._configured = False
                self._exchange.wait(lambda: False, 0.05)
        for last_word in (self._halt, self._release) if self._released else (self._halt,):
            try:
                last_word()
            except NoReply:
                pass  # it is written; nobody waits for the reply

    def _halt(self) -> None:
        self._drive(0.0, 0.0)

    def _round(self, cycle: int) -> None:
        """Ask once, repeat a zero that may be lost, and take back motors that the board let go."""
        if self._late:
            self._barrier()
            self._late = False
        with self._changed:
            if self._zeros and self._command == (0.0, 0.0):
                self._zeros -= 1
                self._pending = True
        self._send_pending()
        self._poll(cycle)
        never = self._command_stamp == -math.inf
        still = self._command == (0.0, 0.0) and (
            never or time.monotonic() - self._command_stamp < self._command_timeout
        )
        if not self._armed and not self._released and still and cycle % 5 == 0:
            self._arm()  # only while somebody asks it to stand still
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
        with (
            self._changed
        ):  # held while a frame is queued, so that two threads cannot swap a command and a zero
            if not self._pending:
                return
            self._pending = False
            first, second = self._command
            if (first != 0.0 or second != 0.0) and (
                self._released or not self._armed or not self._configured
            ):
                self._counters["refused_commands"] += 1
                first = second = 0.0
            try:
                self._drive(first, second)
                if self._released:
                    self._release()
            except NoReply:
                # perhaps it was not heard: questions feed the board's watchdog, so say it again
                self._pending = True
                raise

    def _guard(self) -> None:
        """Replace a command that has become old by zero.

        Asking alone keeps some boards' watchdogs fed.
        """
        with self._changed:
            if (
                self._command != (0.0, 0.0)
                and time.monotonic() - self._command_stamp > self._command_timeout
            ):
                self._command, self._pending, self._zeros = (0.0, 0.0), True, self._repeats()
                self._counters["stale_commands"] += 1
        self._send_pending()

    def _ask(self, frame: bytes, key: Hashable) -> tuple[bytes, float]:
        """Ask a question, after a command that came meanwhile; returns reply and stamp [s]."""
        reply = self._exchange.ask(frame, key)
        self._send_pending()
        return reply

    def _restarted(self) -> None:
        """Note that the board was switched off and on.

        Its counters begin anew, and nobody knows how far the robot rolled.
        """
        with self._changed:
            self._odometry.rebase()
            self._counters["board_restarts"] += 1
            self._jumped = time.monotonic()
        self._configured = False

    def _moved(
        self, counts: tuple[float, float], speeds: tuple[float, float], stamp: float
    ) -> None:
        """Take counters and speeds (motor turns per second) of both channels into the odometry."""
        left, right = self._geometry.from_channels(*speeds)
        v, omega = self._geometry.body(left, right)
        fastest = (ABSURD * self._geometry.max_wheel_speed + 1.0) / self._geometry.wheel_radius
        if not (
            math.isfinite(counts[0] + counts[1]) and abs(left) <= fastest and abs(right) <= fastest
        ):
            raise self._exchange.refuse(f"counters {counts}, speeds {speeds}")
        with self._changed:
            if not self._odometry.update(*counts, stamp):
                self._counters["odometry_jumps"] += 1
                self._jumped = stamp
                return
            self._state = State(
                self._odometry.x, self._odometry.y, self._odometry.theta, v, omega, stamp
            )
            self._changed.notify_all()

    # Small things

    def _repeats(self) -> int:
        return 0 if self.answers_commands else ZEROS

    def _settle(self) -> None:
        """Let what is late arrive and be thrown away before the next request."""
        self._exchange.wait(lambda: False, SETTLE)

    def _why_silent(self, timeout: float) -> str:
        """Say why `connect` failed, in words a user can act on."""
        counters, faults = (
            {**self._transport.counters, **self._exchange.counters},
            self._errors + self._trouble,
        )
        if not self._transport.connected:
            return f"{self.board}: {self._transport.last_error or 'the link is down'}"
        if faults and counters["frames"]:
            return f"{self.board}: answers, but cannot drive: {'; '.join(faults)}"
        if counters["bytes_in"] == 0:
            return f"{self.board}: no answer within {timeout:g} s: {self.hint}"
        if counters["frames"] == 0:
            return (
                f"{self.board}: {counters['bytes_in']} bytes came and none made sense: "
                f"wrong baud rate or protocol? {self.hint}"
            )
        return (
            f"{self.board}: answers come, but too few within {timeout:g} s: "
            f"{counters['timeouts']} are missing: {self.hint}"
        )
