"""An ArduPilot-like rover at the other end of a MAVLink link.

Real bytes, the measured behaviour of Rover 4.6.3, physics of `kmpc_lite`.
"""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.link import Transport
from firmware_bridge.link.server import serve
from kmpc_lab.emulator.rover.autopilot import Autopilot
from kmpc_lab.emulator.rover.estimator import Estimator, Parameters
from kmpc_lab.emulator.rover.physics import RoverPhysics
from kmpc_lab.emulator.rover.protocol import Protocol
from kmpc_lab.emulator.rover.telemetry import Telemetry

log = logging.getLogger(__name__)
CHUNK = 50  # bytes of one STATUSTEXT
LONGEST_CATCH_UP = 1.0  # after a stall longer than this the rover has lost that time [s]


class RoverEmulator:
    """The emulated rover: `start` serves it on a link, `step` drives it by hand on any clock.

    Messages are taken and sent in the main loop of 50 Hz, as the real one does: hence its round
    trip of about 10 ms.

    `slip`, `turn_gain`, `seed`: of `kmpc_lab.sim.plants.robots.DifferentialDrive`. `pose`: where it
    starts: x, y [m], theta [rad], ENU. `clock`: monotonic time [s]. `parameters`: ArduPilot
    parameters other than delivered. `arm_after`: arming is refused this long after boot [s]; the
    real one takes 25 to 45 s. `uptime`: how long ago it booted [s]. `system`: its MAVLink id.
    `key`: signing key, 32 bytes. `signature_ahead`: how far its signature clock runs ahead of wall
    time [s]: the real one adds a minute to the time that it has stored. `accept_unsigned`: with a
    key: whether what is unsigned, or wrongly signed, is obeyed all the same, as on the real one's
    SERIAL0. `noise`: standard deviation of the slow error of its position, with GPS [m]. `physics`:
    another rover; slip, turn gain and seed are then its own.

    Examples
    --------
    >>> times = iter([0.0, 0.5])
    >>> rover = RoverEmulator(clock=lambda: next(times))
    >>> rover.step()
    >>> rover.pose, rover.stopped
    ((0.0, 0.0, 0.0), True)
    """

    def __init__(
        self,
        slip: float = 0.0,
        turn_gain: float = 1.0,
        seed: int = 0,
        *,
        pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
        clock: Callable[[], float] = time.monotonic,
        parameters: Mapping[str, float] | None = None,
        arm_after: float = 2.0,
        uptime: float = 0.0,
        system: int = 1,
        key: bytes | None = None,
        signature_ahead: float = 60.0,
        accept_unsigned: bool = False,
        noise: float = 0.0,
        physics: RoverPhysics | None = None,
    ) -> None:
        self.parameters = Parameters(parameters)
        self._physics = RoverPhysics(slip, turn_gain, seed) if physics is None else physics
        self._physics.place(*pose)
        self._clock, self._arm_after, self._system = clock, arm_after, system
        self._lock = threading.RLock()
        self._noise, self._seed = noise, seed
        self._codec = MavlinkCodec(
            system,
            1,
            key=key,
            wall_time=time.time() + signature_ahead,
            accept_unsigned=accept_unsigned,
        )
        self._signature_ahead = signature_ahead
        self._inbox: list[tuple[bytes, float]] = []
        self._write: Callable[[bytes], object] = lambda frame: None
        self._transport: Transport | None = None
        self._thread: threading.Thread | None = None
        self._closing = threading.Event()
        self.internal_errors = 0
        self.reboots = -1
        self._texts = 0
        self._boot(uptime)

    def _boot(self, uptime: float) -> None:
        estimator = Estimator(self.parameters, 0.6 * self._arm_after, self._noise, self._seed)
        self.autopilot = Autopilot(self.parameters, self._physics, estimator, self._arm_after)
        self.autopilot.uptime = uptime
        self._telemetry = Telemetry(self.autopilot)
        self._protocol = Protocol(
            self.autopilot, self._telemetry, self._send, self._system, self._set_up_signing
        )
        self._booted = self._clock() - uptime
        self._next = uptime
        self.reboots += 1

    def start(self, url: str) -> None:
        """Serve the rover on a link (pty:, tcp:, udp:) until `close`; LinkError if that fails."""
        transport = serve(url)
        self.connect(transport.write)
        transport.start(self.receive)
        self._transport = transport
        self._thread = threading.Thread(target=self._run, name="rover", daemon=True)
        self._thread.start()

    def connect(self, write: Callable[[bytes], object]) -> None:
        """Send frames to this callable."""
        self._write = write

    def receive(self, data: bytes, stamp: float) -> None:
        """Take bytes; they are looked at in the next turn of the main loop."""
        with self._lock:
            self._inbox.append((data, stamp))

    def step(self) -> None:
        """Run the main loop up to the present time."""
        with self._lock:
            uptime, period = self._clock() - self._booted, 1.0 / self.parameters["SCHED_LOOP_RATE"]
            if uptime - self._next > LONGEST_CATCH_UP:
                self._next = uptime
            while self._next <= uptime + 1e-9:
                self._turn(self._next, period)
                self._next += period
                if self._protocol.reboot:
                    self._boot(0.0)
                    return

    @property
    def pose(self) -> tuple[float, float, float]:
        """True pose, ENU: x, y [m], theta [rad]."""
        with self._lock:
            return self._physics.pose

    @property
    def velocity(self) -> tuple[float, float, float]:
        """True velocity: east, north [m/s], turn rate counter-clockwise [rad/s]."""
        with self._lock:
            return self._physics.velocity

    @property
    def stopped(self) -> bool:
        """Whether it stands."""
        with self._lock:
            return self._physics.stopped

    @property
    def mode(self) -> str:
        """Name of its mode."""
        with self._lock:
            return str(
                dialect.enums["ROVER_MODE"][self.autopilot.mode].name.removeprefix("ROVER_MODE_")
            )

    @property
    def armed(self) -> bool:
        """Whether it is armed."""
        return self.autopilot.armed

    @property
    def counters(self) -> dict[str, int]:
        """Counts of what came and what was made of it.

        `aborts` counts the set-points that make the real autopilot abort.
        """
        with self._lock:
            more = {
                "ignored": self._protocol.ignored,
                "reboots": self.reboots,
                "internal_errors": self.internal_errors,
            }
            return {**self._codec.counters, **self.autopilot.counters, **more}

    def place(self, x: float, y: float, theta: float) -> None:
        """Put the rover down somewhere: [m], [m], [rad]."""
        with self._lock:
            self._physics.place(x, y, theta)

    def pilot_mode(self, mode: int) -> bool:
        """A pilot's mode switch; False if the mode cannot be entered."""
        with self._lock:
            return self.autopilot.set_mode(mode)

    def pilot_arm(self, armed: bool = True) -> bool:
        """A pilot's arming switch; False if arming is refused."""
        with self._lock:
            if armed:
                return self.autopilot.arm(force=False)
            self.autopilot.disarm()
            return True

    def lose_position(self, lost: bool = True) -> None:
        """Break the pose estimate, or mend it."""
        with self._lock:
            self.autopilot.estimator.broken = lost

    def close(self) -> None:
        """Stop serving; idempotent."""
        self._closing.set()
        if self._thread is not None:
            self._thread.join()
        if self._transport is not None:
            self._transport.close()

    def _run(self) -> None:
        due = time.monotonic()
        while not self._closing.is_set():
            try:
                self.step()
            except (
                Exception
            ):  # the rover of a desk is to outlive whatever it is sent; tests look at the count
                self.internal_errors += 1
                log.exception("emulated rover")
            due = max(due + 1.0 / self.parameters["SCHED_LOOP_RATE"], time.monotonic())
            self._closing.wait(due - time.monotonic())

    def _turn(self, uptime: float, period: float) -> None:
        """One turn of the main loop: take what came, move, tell."""
        self.autopilot.uptime = uptime
        inbox, self._inbox = self._inbox, []
        for data, stamp in inbox:
            for message in self._codec.feed(data, stamp):
                self._protocol.on_message(message)
        self.autopilot.step(uptime, period)
        self._protocol.step()
        if self.autopilot.mode_changed:
            self.autopilot.mode_changed = False
            self._send(self._telemetry.heartbeat())
        for message in self._telemetry.due():
            self._send(message)
        while self.autopilot.texts:
            severity, text = self.autopilot.texts.popleft()
            self._say(severity, text.encode())

    def _say(self, severity: int, text: bytes) -> None:
        """Send a text; a long one in numbered chunks, the last of them short or empty."""
        if len(text) <= CHUNK:
            self._send(dialect.MAVLink_statustext_message(severity, text))
            return
        self._texts = self._texts % 65535 + 1
        for chunk in range(len(text) // CHUNK + 1):
            part = text[CHUNK * chunk : CHUNK * (chunk + 1)]
            self._send(dialect.MAVLink_statustext_message(severity, part, self._texts, chunk))

    def _set_up_signing(self, key: bytes, timestamp: int) -> None:
        """Take a key, and a minute on the time stamp; a key and a time of zeros end signing."""
        if timestamp == 0 and not any(key):
            self._codec.sign_no_more()
        else:
            self._codec.sign(key, timestamp + round(self._signature_ahead * 1e5))

    def _send(self, message: Any) -> None:
        self._write(self._codec.encode(message))
