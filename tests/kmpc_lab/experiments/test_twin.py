"""The digital twin under emulated boards, driven through real bytes."""

import json
import math
import os
import signal
import subprocess
import sys
import time

import pytest
from boards import TABLES
from courses import PATIENT
from mavlink_rig import Rig
from robots import Clock

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link.framing import roboclaw_packet
from kmpc_lab.emulator.mocap import Mocap, MocapOptions
from kmpc_lab.emulator.roboclaw import RoboClawEmulator
from kmpc_lab.emulator.twin import TwinBody, TwinRover
from kmpc_lab.sim.twin import Twin
from kmpc_lite.cli.main import main


@pytest.fixture
def board():
    clock = Clock()
    emulator = RoboClawEmulator.from_options(TABLES["roboclaw"], clock=clock)
    twin = Twin(pose=(0.2, 0.1, 0.4))
    emulator.put_on(TwinBody(emulator.geometry, twin, clock()))
    return clock, emulator, twin


def turns_per_second(emulator, v, omega):
    return emulator.geometry.to_channels(*emulator.geometry.wheels(v, omega))


def test_a_roboclaw_turns_the_twins_wheels_and_its_watchdog_stops_them(board):
    clock, emulator, twin = board
    emulator.handle(roboclaw_packet(0x80, 14, bytes((5,))))
    counts = [round(1440 * s) for s in turns_per_second(emulator, 0.3, 0.0)]
    for _ in range(50):
        clock.now += 0.02
        emulator.handle(
            roboclaw_packet(0x80, 37, b"".join(c.to_bytes(4, "big", signed=True) for c in counts))
        )
    x, y, theta = emulator.pose
    travelled = math.hypot(x - 0.2, y - 0.1)
    assert 0.2 < travelled < 0.3 and abs(theta - 0.4) < 0.02
    clock.now += 3.0
    assert emulator.pose[0] - x < 0.3 * math.cos(0.4) * 0.9
    assert emulator.stopped and max(map(abs, twin.velocity)) < 1e-3


def test_the_rovers_loops_turn_the_twin_as_commanded_though_its_wheels_slide():
    twin = Twin()
    rig = Rig(MavlinkOptions(arm=True), physics=TwinRover(twin))
    rig.take()
    rig.drive(0.3, 0.4, 3.0)
    before = twin.pose[2]
    rig.drive(0.3, 0.4, 3.0)
    assert twin.pose[2] - before == pytest.approx(1.2, rel=0.06)
    assert math.hypot(*twin.velocity[:2]) == pytest.approx(0.3, rel=0.06)
    rig.drive(0.0, 0.0, 3.0)
    assert rig.rover.stopped or max(map(abs, twin.velocity)) < 5e-3


def test_motion_capture_has_a_rate_a_delay_noise_and_drop_outs():
    mocap = Mocap(
        MocapOptions(rate=100.0, noise=0.002, delay=0.03, dropouts=1.0, hidden=0.2), 1, 0.0
    )
    came = [
        (0.01 * k, stamp, pose)
        for k in range(2000)
        for stamp, pose in mocap.look(0.01 * k, (1.0, 2.0, 3.0))
    ]
    assert all(abs(now - stamp - 0.03) < 0.0101 for now, stamp, _ in came)
    assert 1200 < len(came) < 1900
    xs = [pose[0] for _, _, pose in came]
    mean = sum(xs) / len(xs)
    assert (
        abs(mean - 1.0) < 3e-4
        and 0.0015 < math.sqrt(sum((x - mean) ** 2 for x in xs) / len(xs)) < 0.0025
    )
    gaps = [b[1] - a[1] for a, b in zip(came, came[1:], strict=False)]
    assert max(gaps) == pytest.approx(0.2, abs=0.03) or max(gaps) > 0.2


def test_the_twin_is_driven_past_an_obstacle_through_a_pty(desk, capsys):
    """The short drive of every test run.

    Real bytes over a pseudo-terminal, the gate, the controller, and physics at the other end.
    """
    command = [
        sys.executable,
        *"-m kmpc_lite.cli.main emulate mavlink --physics mujoco --scenario course.toml".split(),
    ]
    emulator = subprocess.Popen(
        [*command, "--link", "pty:link", "--arm-after", "0.1", "--json"],
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        end = time.monotonic() + 60.0
        while not os.path.exists("link") and time.monotonic() < end:
            time.sleep(0.05)
        limits = "--v-max 0.5 --omega-max 1.0 --latency 0.15"
        robot = f"--driver mavlink --link pty:link --arm {limits}".split()
        quick = [*PATIENT, *"--set safety.hold=0.3 --settle 0.3 --seconds 25 --json".split()]
        status = main(["run", *robot, *quick, "--scenario", "course.toml"])
    finally:
        emulator.send_signal(signal.SIGINT)
        said, _ = emulator.communicate(timeout=60.0)
    report = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert status == 0 and report["outcome"] == "arrived" and report["clearance_m"] > 0.0, report
    x, y, _ = json.loads(said.splitlines()[-1])["pose"]
    assert math.hypot(x - 0.7, y - 0.15) < 0.08
