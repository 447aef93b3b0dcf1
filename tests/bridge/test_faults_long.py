"""Random faults of link, board and controller: what the wire may carry meanwhile, and what must
come back after.

The whole of driver core, gate, loop and emulated rover runs on a clock turned by hand; only the
drivers' threads are left out. What the bridge writes and what reaches it is judged by decoders of
the test's own.
"""

import math
import random
import resource
import threading
import time
from collections import Counter

import pytest
from robots import Clock
from wire_decoders import (
    MavlinkEar,
    armed_in_guided,
    mavlink_frame,
    odrive_speeds,
    position,
    roboclaw_speeds,
    set_point,
    vesc_erpm,
    with_nan,
)

from firmware_bridge.cli.emulate import build_emulator
from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.emulator.rover.rover import RoverEmulator
from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.link import Faults, LoopbackWire, open_transport
from firmware_bridge.link.log import Chunk, RecordedTransport
from firmware_bridge.link.loopback import named_wire
from firmware_bridge.messages import VelocityCommand
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.limits import Limits

TICK = 0.02
LATEST = 0.3
"""Of the loss of what is depended on [s]."""
LIMITS = Limits(
    v_max=0.5,
    v_reverse=0.4,
    omega_max=1.0,
    acceleration=1.0,
    deceleration=1.5,
    angular_acceleration=4.0,
    angular_deceleration=5.0,
)
ROUNDING = 1e-6
"""Set-points are float32."""
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

    def send(self, v: float, omega: float) -> None:
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
            age = now - stamp
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


def suffer(world: World) -> None:
    """One stretch of faults, and what must hold after it."""
    draw, before = world.random.uniform, world.gate.state
    assert before is GateState.ACTIVE
    level = world.random.choice((0.05, 0.2, 0.5))
    world.wire.faults = Faults(
        drop=draw(0, level),
        duplicate=draw(0, level),
        corrupt=draw(0, level),
        reorder=draw(0, level),
        split=draw(0, level),
        cut=draw(0, 0.1 * level),
        cut_for=draw(0.02, 0.4),
        delay=draw(0, 0.1) if world.random.random() < 0.5 else 0.0,
    )
    world.outage = world.random.choice(OUTAGES)
    world.counts[world.outage] += 1
    world.counts["outages"] += world.outage != "none"
    if world.outage == "cut":
        world.wire.cut(draw(0.05, 3.0))
    elif world.outage == "ekf":
        world.rover.lose_position()
    elif world.outage == "pilot":
        world.rover.pilot_mode(world.random.choice((0, 4)))
    elif world.outage == "disarmed":
        world.rover.pilot_arm(False)
    elif world.outage == "estop":
        world.desk.requests.add("stop")
    world.run(draw(0.1, 4.0))
    world.rover.lose_position(False)
    world.outage, world.wire.faults = "none", Faults()
    world.wire.heal()
    world.run(2.5)
    state = world.gate.state
    world.counts[f"then {state.name}"] += 1
    if state in (GateState.ESTOP, GateState.YIELDED, GateState.RELEASED, GateState.IDLE):
        world.desk.requests.add("reset")
        world.run(0.1)
        world.desk.requests.add("enable")
        world.run(6.0)
    assert world.gate.state is GateState.ACTIVE, (
        f"does not drive again after {state}: {world.loop.snapshot}"
    )
    assert world.rover.armed and world.rover.mode == "GUIDED"


def endure(seed: int, faults: int) -> World:
    """Suffer so many faults."""
    world = World(seed)
    world.connect()
    while world.faults < faults:
        suffer(world)
    world.gate.stop()
    world.run(4.0)
    assert world.gate.done and world.rover.stopped and world.rover.mode == "HOLD"
    assert world.loop.statistics.driver_errors == 0, world.loop.statistics.last_error
    assert world.rover.counters["aborts"] == 0
    assert world.counts["moving"] > faults / 20
    return world


def test_faults_of_all_kinds_never_let_a_bad_command_onto_the_wire():
    world = endure(1, 600)
    assert {GateState.YIELDED, GateState.ACTIVE} <= {
        GateState[name[5:]] for name in world.counts if name.startswith("then ")
    }


@pytest.mark.long
def test_a_hundred_thousand_faults():
    world = endure(3, 100_000)
    assert world.faults >= 100_000
    assert (
        set(OUTAGES) <= set(world.counts)
        and world.counts["then ACTIVE"] > 100
        and world.counts["then RELEASED"] > 10
    )


HOURS = 10.0
"""Of the soak, on the clock of the test."""


@pytest.mark.long
def test_ten_hours_leak_nothing_drift_nowhere_and_miss_no_stop():
    """Drive for a minute, stop, stand, enable: for ten hours."""
    world = World(11)
    world.connect()
    began, stops, sizes = world.clock(), 0, []
    while world.clock() - began < HOURS * 3600.0:
        world.run(55.0)
        assert world.gate.state is GateState.ACTIVE, world.loop.snapshot
        world.desk.requests.add("stop")
        world.run(2.0)
        assert world.rover.stopped and world.gate.state is GateState.ESTOP
        stops += 1
        world.desk.requests.add("reset")
        world.run(0.1)
        world.desk.requests.add("enable")
        world.run(2.9)
        state, (x, y, theta) = world.core.state, world.rover.pose
        assert math.hypot(state.x - x, state.y - y) < 0.1
        assert abs(math.remainder(state.theta - theta, math.tau)) < 0.05
        assert world.core.frame.doubt == ""
        sizes.append(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0)
    assert stops >= 590
    assert sizes[-1] - sizes[len(sizes) // 10] < 5.0, "MB"
    assert world.loop.statistics.driver_errors == 0, world.loop.statistics.last_error


BOARD_LIMITS = Limits(v_max=0.3, v_reverse=0.2, omega_max=0.8)
GEOMETRY = WheelGeometry(wheel_radius=0.05, track=0.3, max_wheel_speed=1.0)
SHAPE = {"wheel_radius": 0.05, "track": 0.3, "max_wheel_speed": 1.0}
BOARDS = {
    "roboclaw": {"counts_per_turn": 4000.0, "watchdog": 0.3},
    "odrive": {},
    "vesc": {"can_id": 1, "pole_pairs": 7},
    "roboteq": {"counts_per_turn": 4000.0},
    "arduino": {"counts_per_turn": 4000.0},
}


def wait_for(condition, seconds: float) -> bool:
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return True
        time.sleep(0.01)
    return False


class SerialEar:
    """Judges what goes out to a motor controller: both wheels, as soon as each is told."""

    def __init__(self, board: str) -> None:
        self.board, self.turns, self.commands = board, [0.0, 0.0], 0

    def __call__(self, chunk: Chunk) -> None:
        if chunk.incoming:
            return
        if self.board == "roboclaw":
            speeds = roboclaw_speeds(chunk.data)
            told = {} if speeds is None else {0: speeds[0] / 4000.0, 1: speeds[1] / 4000.0}
        elif self.board == "odrive":
            told = odrive_speeds(chunk.data)
        elif self.board == "roboteq":
            words = [word.split() for word in chunk.data.split(b"\r") if word.startswith(b"!S")]
            told = {int(channel) - 1: int(rpm) / 60.0 for _, channel, rpm in words}
        elif self.board == "arduino":
            words = chunk.data.split(b"*")[0].split()
            driven = words[:1] == [b"V"]
            told = {i: int(words[2 + i]) / 4000.0 for i in (0, 1)} if driven else {}
        else:
            told = {
                int(second): erpm / 60.0 / 7.0 for second, erpm in vesc_erpm(chunk.data).items()
            }
        if not told:
            return
        self.commands += 1
        for wheel, turns in told.items():
            assert math.isfinite(turns)
            self.turns[wheel] = turns
            # one wheel goes as fast as both speeds together allow
            fastest = (
                (BOARD_LIMITS.v_max + BOARD_LIMITS.omega_max * GEOMETRY.track / 2.0)
                / GEOMETRY.wheel_radius
                / math.tau
            )
            assert abs(turns) <= fastest + 1e-3


@pytest.mark.long
@pytest.mark.parametrize("board", BOARDS)
def test_serial_boards_in_real_time(board):
    """The same for the motor controllers, whose drivers have threads of their own.

    What must hold does not depend on speed.
    """
    robot = load_robot(
        None,
        {
            "link": {"url": f"loopback:{board}", "driver": board},
            "board": BOARDS[board],
            "geometry": SHAPE,
        },
    )
    wire = named_wire(board, Faults(), 5)
    emulator = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.0)
    emulator.start(robot.link.url)
    failures: list[AssertionError] = []
    ear = SerialEar(board)

    def judge(chunk: Chunk) -> None:
        try:
            ear(chunk)
        except AssertionError as error:
            failures.append(error)

    driver = open_driver(robot, RecordedTransport(open_transport(robot.link.url), judge))
    driver.connect(5.0)
    gate, desk = SafetyGate(GateSettings(BOARD_LIMITS, pilot=False)), Desk()

    def control(state):
        now = time.monotonic()
        return VelocityCommand(0.7 * math.sin(0.9 * now), 1.4 * math.cos(0.7 * now), now)

    loop = ControlLoop(driver, gate, Planner(control, driver.state, 0.05), operator=desk)
    gate.enable()
    thread = threading.Thread(target=loop.run)
    thread.start()
    draw = random.Random(7)
    recovered = Counter()
    try:
        for _ in range(8):
            assert wait_for(lambda: gate.state is GateState.ACTIVE, 10.0), loop.snapshot
            level = draw.choice((0.02, 0.1, 0.3))
            wire.faults = Faults(
                **{
                    name: draw.uniform(0, level)
                    for name in ("drop", "duplicate", "corrupt", "reorder", "split")
                }
            )
            what = draw.choice(("noise", "cut", "mute", "reboot", "long cut"))
            if what == "cut":
                wire.cut(0.6)
            elif what == "long cut":
                wire.cut(2.5)
                assert wait_for(
                    lambda: loop.snapshot.output.v == loop.snapshot.output.omega == 0.0, 5.0
                )
            elif what == "mute":
                emulator.mute = True
            elif what == "reboot":
                emulator.reboot()
            time.sleep(draw.uniform(0.5, 2.0))
            emulator.mute, wire.faults = False, Faults()
            wire.heal()
            if not wait_for(lambda: gate.state is GateState.ACTIVE, 3.0):
                recovered[f"{what}: enabled"] += 1
                desk.requests.add("enable")
            else:
                recovered[f"{what}: by itself"] += 1
        assert wait_for(lambda: gate.state is GateState.ACTIVE, 10.0), loop.snapshot
    finally:
        loop.request_stop("test")
        thread.join(10.0)
        driver.close()
        still = wait_for(lambda: emulator.stopped, 2.0)
        emulator.close()
    assert not failures, failures[0]
    assert (
        still
        and ear.commands > 100
        and loop.statistics.driver_errors == 0
        and sum(recovered.values()) == 8
    )
