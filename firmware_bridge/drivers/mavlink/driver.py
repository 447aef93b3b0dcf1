"""MAVLink driver for ArduPilot Rover: velocity and turn rate in GUIDED mode.

PX4 is not driven: its rovers take a velocity vector for speed and heading and ignore the turn rate,
and its manual control was not tested against anything. A vehicle that is no ArduPilot rover is
refused.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import fields, replace
from typing import Any

from firmware_bridge.drivers.mavlink.codec import SigningStamp
from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link import Transport
from firmware_bridge.messages import ConfigError, LinkError, LinkStatus, State

TICK = 0.047
"""Period of the driver's thread [s]: no multiple of an autopilot's loop period, or all TIMESYNC
requests would wait equally long in that loop."""
FAREWELL = 1.0  # how long `close` waits for HOLD to be confirmed [s]


class MavlinkDriver:
    """The near end of a MAVLink link to an ArduPilot rover.

    Telemetry comes as often as the vehicle gives it; stamps are the vehicle's own, brought to our
    clock by TIMESYNC. Set-points are handed to the link in the thread that calls `send`;
    heartbeats, requests and retries in a thread of the driver.

    `transport`: the link, not yet started. `options`: system ids, and whether to arm. `clock`:
    monotonic time [s].

    Examples
    --------
    >>> from firmware_bridge.link import open_transport
    >>> driver = MavlinkDriver(open_transport("tcp:127.0.0.1:5760"), MavlinkOptions(arm=True))
    >>> driver.health().connected
    False
    """

    def __init__(
        self,
        transport: Transport,
        options: MavlinkOptions | None = None,
        *,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._transport, self._clock = transport, clock
        options = MavlinkOptions() if options is None else options
        self._stamp = SigningStamp(options.key_file)
        wall_time = max(time.time(), self._stamp.unix_time)
        self._core = MavlinkCore(options, transport.write, wall_time)
        self._changed = threading.Condition()
        self._started, self._closing = False, False
        self._thread: threading.Thread | None = None
        self._internal_errors, self._internal_error = 0, ""

    @classmethod
    def from_options(cls, transport: Transport, table: Mapping[str, Any]) -> MavlinkDriver:
        """Build it from a robot file: its ``[board]`` section holds the fields of `MavlinkOptions`.

        Raises ConfigError: names the key.
        """
        astray = [entry.name for entry in fields(MavlinkOptions) if entry.name in table]
        if astray:
            raise ConfigError(f"{astray[0]}: expected in [board], not at the top")
        return cls(transport, MavlinkOptions.from_table(table.get("board", {})))

    def connect(self, timeout: float) -> None:
        """Open the link, find the vehicle, request telemetry, turn its failsafe on.

        With `arm`, begin to take control of the vehicle. That goes on after the return: arming may
        be refused for 45 s after boot. `health().ready` tells when it is done.

        Raises LinkError if the link cannot be opened, or no ArduPilot rover answers within
        `timeout` [s].
        """
        if not self._started:
            self._transport.start(self._on_bytes)
            self._started = True
            self._thread = threading.Thread(target=self._run, name="mavlink", daemon=True)
            self._thread.start()
        core, deadline = self._core, time.monotonic() + timeout
        with self._changed:
            while not (core.identified and core.streams.answered) and not core.wrong_vehicle:
                left = deadline - time.monotonic()
                if left <= 0.0:
                    break
                self._changed.wait(left)
            if core.wrong_vehicle:
                raise LinkError(f"mavlink: {core.wrong_vehicle}")
            if not core.identified:
                raise LinkError(self._nobody(timeout))
            if not core.streams.answered:
                raise LinkError(self._one_way(timeout))
            if core.options.arm:
                core.take(self._clock())

    def state(self) -> State | None:
        """Newest state, None before the first."""
        return self._core.state

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command forward speed [m/s] and turn rate, counter-clockwise [rad/s].

        Zeros are always sent. Anything else is held back and counted while we do not control the
        vehicle (not armed, not in GUIDED, or being given back).
        """
        with self._changed:
            self._core.set_point(v, omega, self._clock())

    def take(self) -> None:
        """Ask for GUIDED and arming, again where they were lost or given back."""
        with self._changed:
            self._core.take(self._clock())

    def stop(self) -> None:
        """Command zero speed, then HOLD until it is confirmed; a pilot's mode is left alone."""
        with self._changed:
            self._core.stop(self._clock())

    def feed_pose(self, x: float, y: float, theta: float, stamp: float) -> None:
        """Pass on a pose from motion capture: ENU [m, m, rad] at `time.monotonic()` [s].

        Bad poses are refused and counted.
        """
        with self._changed:
            self._core.feed_pose(x, y, theta, stamp, self._clock())

    def health(self) -> LinkStatus:
        """What is known of the vehicle and the link."""
        with self._changed:
            status = self._core.status(self._clock(), self._transport.connected)
        faults = status.faults
        counters = {
            **self._transport.counters,
            **status.counters,
            "internal_errors": self._internal_errors,
        }
        if self._internal_error:
            faults = (*faults, self._internal_error)
        return replace(status, faults=faults, counters=counters)

    def notes(self) -> tuple[str, ...]:
        """Remarks that stop no robot: set-up of the failsafe, last texts of the vehicle."""
        with self._changed:
            return self._core.notes(self._clock())

    def refusals(self) -> tuple[str, ...]:
        """Why the autopilot would not arm, in its own words, as far as it has said."""
        with self._changed:
            return self._core.refusals(self._clock())

    def warnings(self) -> tuple[str, ...]:
        """What a user should know while the robot drives."""
        with self._changed:
            warnings = self._core.warnings(self._clock())
        return (*warnings, self._stamp.problem) if self._stamp.problem else warnings

    def ask_prearm(self) -> None:
        """Ask the autopilot to say what keeps it from arming: `refusals` then tells."""
        with self._changed:
            self._core.ask_prearm(self._clock())

    def confirm_frame(self) -> None:
        """Trust the vehicle's frame again, after it was checked on the map."""
        with self._changed:
            self._core.confirm_frame()

    def close(self) -> None:
        """Stop a vehicle that moves on our command, and close the link; idempotent.

        It waits up to a second until the vehicle confirms HOLD.
        """
        with self._changed:
            if self._closing:
                return
            if self._core.owes_stop:
                self._core.stop(self._clock())
            deadline = time.monotonic() + FAREWELL
            while (
                self._core.stopping
                and self._transport.connected
                and (left := deadline - time.monotonic()) > 0.0
            ):
                self._changed.wait(left)
            self._closing = True
            self._changed.notify_all()
        if self._thread is not None:
            self._thread.join()
        self._transport.close()

    def _nobody(self, timeout: float) -> str:
        counters, transport = self._core.counters, self._transport.counters
        start = (
            f"mavlink: no heartbeat of system {self._core.options.system} within {timeout:g} s: "
        )
        if counters["bad_signature"]:
            return start + (
                f"{counters['bad_signature']} wrongly signed frames: is board.key_file the "
                "vehicle's key?"
            )
        if counters["unsigned"]:
            return start + (
                f"{counters['unsigned']} unsigned frames: the vehicle has no key; give it ours "
                "by a ground station, or leave board.key_file out"
            )
        if counters["others"]:
            return start + f"{counters['others']} frames of other systems: is the id right?"
        if transport.get("bytes_in", 0):
            return start + (
                f"{transport['bytes_in']} bytes, but no frame: is the baud rate right, "
                "is it MAVLink?"
            )
        return start + "no byte: is it powered, are the lines crossed?"

    def _one_way(self, timeout: float) -> str:
        core = self._core
        start = f"mavlink: system {core.options.system} is heard, but answers no request within "
        if core.options.key_file is None and core.counters["signed"]:
            return start + (
                f"{timeout:g} s: it signs its frames, and refuses ours, which are not signed: "
                "give board.key_file"
            )
        if core.options.key_file is not None:
            return start + f"{timeout:g} s: one-way link, or it has another key"
        return start + f"{timeout:g} s: one-way link, or signing"

    def _on_bytes(self, data: bytes, stamp: float) -> None:
        """Take what arrived (I/O thread); errors are counted and reported; it goes on."""
        try:
            changed = self._core.receive(data, stamp, self._changed)
        except Exception as error:
            self._note(error)
            changed = True
        if changed:
            with self._changed:
                self._changed.notify_all()

    def _run(self) -> None:
        """Do what is due, period after period, until the driver is closed."""
        while self._turn():
            self._stamp.keep(self._core.codec.newest_stamp, time.monotonic())
        self._stamp.keep(self._core.codec.newest_stamp, float("inf"))

    def _turn(self) -> bool:
        """Do what is due now, and wait a period; return whether to go on."""
        with self._changed:
            try:
                self._core.tick(self._clock())
            except Exception as error:
                self._note(error)
            due = time.monotonic() + TICK
            while not self._closing and (left := due - time.monotonic()) > 0.0:
                self._changed.wait(left)
            return not self._closing

    def _note(self, error: Exception) -> None:
        self._internal_errors += 1
        self._internal_error = f"internal error: {type(error).__name__}: {error}"
