"""Driver core, gate, loop and emulated rover on one clock that is turned by hand, and faults of
all that lies between them; only the drivers' threads are left out.

What the bridge writes and what reaches it is judged by decoders of the tests' own.
"""

import math
import random
from collections import Counter

from loopback import LoopbackWire
from robots import Clock
from wire_decoders import MavlinkEar, armed_in_guided, mavlink_frame, position, set_point, with_nan

from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.messages import VelocityCommand
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings, Limits
from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.emulator.rover.rover import RoverEmulator

TICK = 0.02
LATEST = 0.3  # of the loss of what is depended on [s]
LIMITS = Limits(
    v_max=0.5,
    v_reverse=0.4,
    omega_max=1.0,
    acceleration=1.0,
    deceleration=1.5,
    angular_acceleration=4.0,
    angular_deceleration=5.0,
)
ROUNDING = 1e-6  # set-points are float32
OUTAGES = (
    "none",
    "cut",
    "deaf",
    "mute",
    "no position",
    "no attitude",
    "no EKF report",
    "NaN position",
    "ekf",
    "second master",
    "controller hangs",
    "controller raises",
    "controller NaN",
    "pilot",
    "disarmed",
    "estop",
)
KINDS = {"no position": 32, "no attitude": 30, "no EKF report": 193}


class HandDriver:
    """`MavlinkDriver` without its threads."""

    def __init__(self, core: MavlinkCore, transport, clock: Clock) -> None:
        self.core, self.transport, self.clock = core, transport, clock

    def state(self):
        return self.core.state

    def health(self):
        return self.core.status(self.clock(), self.transport.connected)

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        self.core.set_point(v, omega, self.clock())

    def stop(self) -> None:
        self.core.stop(self.clock())


class Desk:
    """The operator's requests."""

    def __init__(self) -> None:
        self.requests: set[str] = set()

    def take(self):
        taken, self.requests = self.requests, set()
        return taken

    def tell(self, state, why, barred) -> None:
        pass


class World:
    """Everything on one clock."""

    def __init__(self, seed: int) -> None:
        self.random, self.clock = random.Random(seed), Clock()
        self.wire = LoopbackWire(seed=seed, manual=True, clock=self.clock)
        self.rover = RoverEmulator(clock=self.clock, arm_after=0.1, uptime=100.0)
        self.core = MavlinkCore(MavlinkOptions(arm=True, failsafe=False), self.write, 1.7e9)
        self.driver = HandDriver(self.core, self.wire.bridge, self.clock)
        self.gate, self.desk = SafetyGate(GateSettings(LIMITS)), Desk()
        self.planner = Planner(self.control, self.driver.state, 0.1, clock=self.clock)
        self.loop = ControlLoop(
            self.driver,
            self.gate,
            self.planner,
            operator=self.desk,
            take=lambda: self.core.take(self.clock()),
            clock=self.clock,
        )
        self.outage = "none"
        self.sent_ear, self.heard_ear = MavlinkEar(), MavlinkEar()
        self.good = dict.fromkeys(
            ("board", "position", "attitude", "ekf", "controller", "alone"), -math.inf
        )
        """When each was last seen to be good, by the test's own decoder [s]."""
        self.taken = -math.inf
        """When a heartbeat first said that the rover is not armed in GUIDED; infinite while it is
        [s]."""
        self.last = (self.clock(), 0.0, 0.0)
        self.slowest_stop = 0.0
        self.counts: Counter[str] = Counter()
        self.plan_at = self.tick_at = self.clock()
        self.wire.bridge.start(self.hear)
        self.wire.board.start(self.reach)
        self.rover.connect(self.tell)

    # the wire

    def tell(self, frame: bytes) -> None:
        """What the rover says, before anything else can happen to it."""
        kind = int.from_bytes(frame[7:10], "little")
        if kind == KINDS.get(self.outage):
            return
        if kind == 32 and self.outage == "NaN position":
            frame = with_nan(frame)
        self.wire.board.write(frame)

    def write(self, frame: bytes) -> bool:
        """What the bridge sends, judged before anything can happen to it."""
        for kind, payload in self.sent_ear.feed(frame):
            if kind == 84:
                self.judge(*set_point(payload))
        return self.wire.bridge.write(frame)

    def hear(self, data: bytes, stamp: float) -> None:
        """What reaches the bridge."""
        if self.outage == "deaf":
            return
        for kind, payload in self.heard_ear.feed(data):
            self.good["board"] = stamp
            if kind == 32 and all(map(math.isfinite, position(payload))):
                self.good["position"] = stamp
            elif kind == 30:
                self.good["attitude"] = stamp
            elif kind == 193:
                flags = int.from_bytes(payload[20:22], "little")
                if flags & 1 and flags & 2 and flags & 24 and not flags & (128 | 1024):
                    self.good["ekf"] = stamp
            elif kind == 0:
                self.taken = math.inf if armed_in_guided(payload) else min(self.taken, stamp)
        self.core.receive(data, stamp)

    def reach(self, data: bytes, stamp: float) -> None:
        """What reaches the rover."""
        if self.outage != "mute":
            self.rover.receive(data, stamp)

    def judge(self, v: float, omega: float, mask: int, frame: int) -> None:
        """One set-point on the wire."""
        now = self.clock()
        self.counts["set-points"] += 1
        assert (mask, frame) == (0x5C7, 8)
        assert math.isfinite(v) and math.isfinite(omega)
        assert (
            -LIMITS.v_reverse - ROUNDING <= v <= LIMITS.v_max + ROUNDING
            and abs(omega) <= LIMITS.omega_max + ROUNDING
        )
        then, v_before, omega_before = self.last
        self.last = (now, v, omega)
        if (v, omega) == (0.0, 0.0):
            return
        self.counts["moving"] += 1
        step = max(0.0, now - then) + 1e-9
        assert abs(v - v_before) <= max(LIMITS.acceleration, LIMITS.deceleration) * step + ROUNDING
        assert (
            abs(omega - omega_before)
            <= max(LIMITS.angular_acceleration, LIMITS.angular_deceleration) * step + ROUNDING
        )
        assert now - self.taken <= LATEST, "moving set-point to a rover that said it is not ours"
        braking = abs(v) < abs(v_before) or abs(omega) < abs(omega_before)
        for name, stamp in self.good.items():
            age = now - stamp - ROUNDING
            if not braking:
                assert age <= LATEST, f"{name} lost {age:.3f} s ago and not braked"
            # the ramp of the fastest command, and a tick
            longest = (
                LATEST
                + max(
                    LIMITS.v_max / LIMITS.deceleration,
                    LIMITS.omega_max / LIMITS.angular_deceleration,
                )
                + TICK
            )
            assert age <= longest, f"{name} lost {age:.3f} s ago and still moving"
            if braking:
                self.slowest_stop = max(self.slowest_stop, age)

    # the bridge's controller

    def control(self, state) -> VelocityCommand:
        """Drive about, faster than allowed; fail as the outage wants it."""
        now = self.clock()
        if self.outage == "controller raises":
            raise RuntimeError("no plan")
        if self.outage == "controller NaN":
            return VelocityCommand(math.nan, 0.1, now)
        self.good["controller"] = now
        return VelocityCommand(0.7 * math.sin(0.9 * now), 1.4 * math.cos(0.7 * now), now)

    # time

    def run(self, seconds: float) -> None:
        """Let time pass."""
        until = self.clock() + seconds
        while self.clock() < until:
            self.clock.now += TICK
            self.rover.step()
            if self.outage == "second master":
                self.wire.board.write(mavlink_frame(84, bytes(52) + b"\x08", 200))
            else:
                self.good["alone"] = self.clock()
            self.wire.pump()
            now = self.clock()
            if now >= self.tick_at:
                self.core.tick(now)
                self.tick_at += 0.05
            if now >= self.plan_at:
                if self.outage != "controller hangs":
                    self.planner.step(now)
                self.plan_at += 0.1
            self.loop.tick(now)
            assert self.loop.statistics.driver_errors == 0, self.loop.statistics.last_error
            self.wire.pump()

    def connect(self) -> None:
        """Find the rover and take it."""
        self.run(2.0)
        assert self.core.identified and self.core.streams.answered
        self.core.take(self.clock())
        self.gate.enable()
        self.run(3.0)
        assert self.gate.state is GateState.ACTIVE

    @property
    def faults(self) -> int:
        """Faults so far: of frames both ways, and outages."""
        return (
            self.wire.bridge.counters["faults"]
            + self.wire.board.counters["faults"]
            + self.counts["outages"]
        )
