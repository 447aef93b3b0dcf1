"""Random faults of motor controllers and their links, in real time."""

import math
import random
import threading
import time
from collections import Counter

import pytest
from faulty_world import Desk
from loopback import Faults, named_wire, serve_on
from waiting import until
from wire_decoders import odrive_speeds, roboclaw_speeds, vesc_erpm

from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.messages import VelocityCommand
from firmware_bridge.recording.link_log import Chunk, RecordedTransport
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.controller_thread import Planner
from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.session import open_driver
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_settings import GateSettings
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.limits import Limits
from kmpc_lab.emulator.build import build_emulator

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
            "link": {"url": f"pty:{board}", "driver": board},
            "board": BOARDS[board],
            "geometry": SHAPE,
        },
    )
    wire = named_wire(board, Faults(), 5)
    emulator = build_emulator(robot, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.0)
    serve_on(emulator, wire)
    failures: list[AssertionError] = []
    ear = SerialEar(board)

    def judge(chunk: Chunk) -> None:
        try:
            ear(chunk)
        except AssertionError as error:
            failures.append(error)

    driver = open_driver(robot, RecordedTransport(wire.take(board=False), judge))
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
            assert until(lambda: gate.state is GateState.ACTIVE, 10.0), loop.snapshot
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
                assert until(
                    lambda: loop.snapshot.output.v == loop.snapshot.output.omega == 0.0, 5.0
                )
            elif what == "mute":
                emulator.mute = True
            elif what == "reboot":
                emulator.reboot()
            time.sleep(draw.uniform(0.5, 2.0))
            emulator.mute, wire.faults = False, Faults()
            wire.heal()
            if not until(lambda: gate.state is GateState.ACTIVE, 3.0):
                recovered[f"{what}: enabled"] += 1
                desk.requests.add("enable")
            else:
                recovered[f"{what}: by itself"] += 1
        assert until(lambda: gate.state is GateState.ACTIVE, 10.0), loop.snapshot
    finally:
        loop.request_stop("test")
        thread.join(10.0)
        driver.close()
        still = until(lambda: emulator.stopped, 2.0)
        emulator.close()
    assert not failures, failures[0]
    assert (
        still
        and ear.commands > 100
        and loop.statistics.driver_errors == 0
        and sum(recovered.values()) == 8
    )
