"""A robot without Linux: its program in QEMU, two serial lines, a simulated robot, and a host."""

import math
import shutil
import socket
import struct
import subprocess
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from boards import GEOMETRY
from free_port import free_port
from loopback import named_wire, serve_on
from waiting import until

import kmpc_lite as kl
from firmware_bridge.drivers.onboard import Kind, OnboardDriver, decoder, message
from firmware_bridge.link import open_transport
from firmware_bridge.messages import LinkError
from kmpc_lab.emulator.onboard import OnboardEmulator

PROGRAM = Path(__file__).parents[3] / "examples" / "firmware"
MISSING = [
    tool for tool in ("arm-none-eabi-gcc", "qemu-system-arm", "make") if shutil.which(tool) is None
]
IN_QEMU = pytest.mark.skipif(bool(MISSING), reason=f"{', '.join(MISSING)} missing")
TRACK = 0.27
CIRCLES = [(0.8, 0.1, 0.2), (1.4, 0.9, 0.2), (1.6, -0.25, 0.2), (2.2, 0.35, 0.25)]
STILL = [(*circle, 0.0, 0.0) for circle in CIRCLES]
PATH = [(0.0, 0.0, 0.65), (0.9, 0.55, 0.65), (0.9, 0.55, -0.2), (1.5, 0.4, -0.2)]
PATH += [(1.9, 0.0, -0.6), (2.2, -0.2, 0.0), (2.9, -0.1, 0.1), (3.0, 0.0, 0.0)]
GOAL = PATH[-1]


@pytest.fixture(scope="module")
def program(tmp_path_factory):
    """The example, built for a Cortex-M7 around an exported controller in float."""
    work = tmp_path_factory.mktemp("firmware")
    anywhere = {"x_min": (-np.inf,) * 3, "x_max": (np.inf,) * 3}
    problem = kl.NavigationProblem(margin=0.03, **anywhere)
    robot = kl.export(kl.nominal_unicycle(0.1), problem, work / "robot", float32=True)
    ask = ["make", "-s", "-j2", "-C", PROGRAM, f"KMPC={robot}", f"BUILD={work / 'built'}"]
    subprocess.run(ask, check=True)
    return work / "built" / "robot.elf"


class Rig:
    """The board, and wheels under it: they turn as it says, and stop if it says nothing."""

    def __init__(self, program):
        self.port, motors, self.debug = free_port(), free_port(), free_port()
        serial = ",server=on,wait=off"
        ask = ["qemu-system-arm", "-M", "mps2-an500", "-display", "none", "-monitor", "none"]
        ask += ["-gdb", f"tcp:127.0.0.1:{self.debug}"]
        ask += ["-kernel", program, "-serial", f"tcp:127.0.0.1:{self.port}{serial}"]
        self._qemu = subprocess.Popen([*ask, "-serial", f"tcp:127.0.0.1:{motors}{serial}"])
        assert until(lambda: self._connect(motors), 20.0)
        self.pose, self.clearance = np.zeros(3), math.inf
        self.wheels, self.frames, self.fastest = (0.0, 0.0), 0, 0.0
        self._closing = False
        self._thread = threading.Thread(target=self._roll, daemon=True)
        self._thread.start()
        self.driver = OnboardDriver.from_options(
            open_transport(f"tcp:127.0.0.1:{self.port}"), {"geometry": GEOMETRY}
        )
        self.sees = True
        self._camera = threading.Thread(target=self._watch, daemon=True)

    def _connect(self, port):
        try:
            self._motors = socket.create_connection(("127.0.0.1", port))
        except OSError:
            return False
        self._motors.settimeout(0.02)
        return True

    def _roll(self):
        frames, last, heard = decoder(), time.monotonic(), time.monotonic()
        while not self._closing:
            try:
                bodies = frames.feed(self._motors.recv(4096))
            except TimeoutError:
                bodies = []
            now = time.monotonic()
            self._advance(now - last)
            last = now
            for body in bodies:
                assert body[1] == Kind.WHEELS
                self.wheels, heard = struct.unpack("<2f", body[2:]), now
                self.frames += 1
            if now - heard > 0.3:
                self.wheels = (0.0, 0.0)

    def _advance(self, seconds):
        left, right = self.wheels
        self.fastest = max(self.fastest, abs(left), abs(right))
        x, y, theta = self.pose
        v, omega = (left + right) / 2.0, (right - left) / TRACK
        middle = theta + 0.5 * seconds * omega
        step = (v * math.cos(middle), v * math.sin(middle), omega)
        self.pose = np.array([x, y, theta]) + seconds * np.array(step)
        gaps = (math.hypot(cx - self.pose[0], cy - self.pose[1]) - r for cx, cy, r in CIRCLES)
        self.clearance = min(self.clearance, min(gaps) - 0.15)

    def _watch(self):
        while not self._closing:
            if self.sees:
                self.driver.feed_pose(*self.pose.tolist(), time.monotonic())
            time.sleep(0.03)

    def connect(self):
        self.driver.connect(20.0)
        self._camera.start()
        return self

    @property
    def stands(self):
        return max(map(abs, self.wheels)) < 1e-6

    def arrived(self):
        return (
            math.dist(self.pose[:2], GOAL[:2]) < 0.05
            and abs(math.remainder(self.pose[2], math.tau)) < 0.15
        )

    def is_beyond(self, x):
        return self.pose[0] > x

    def close(self):
        self._closing = True
        self._thread.join()
        if self._camera.is_alive():
            self._camera.join()
        self.driver.close()
        self._qemu.kill()
        self._qemu.wait()
        self._motors.close()


@pytest.fixture
def rig(program):
    made = Rig(program)
    yield made
    made.close()


@IN_QEMU
def test_it_drives_past_four_circles_to_its_goal(rig):
    """Through garbage, floods and torn frames on its line, which do nothing."""
    rig.connect()
    about = rig.driver.about
    assert (about.horizon, about.circles, about.poses) == (20, 24, 64)
    rng = np.random.default_rng(3)
    goal = message(Kind.GOAL, struct.pack("<3f", *GOAL))
    for _ in range(20):
        rig.driver._transport.write(rng.bytes(700) + goal[:9] + b"\0" + goal[1:])
        time.sleep(0.02)
    assert rig.fastest == 0.0, "nothing that came was a goal"
    rig.driver.drive_to(GOAL, STILL, PATH)
    deadline, refused = time.monotonic() + 90.0, 0
    while not rig.arrived() and time.monotonic() < deadline:
        refused = max(refused, rig.driver.telemetry.bad)
        rig.driver._transport.write(b"\0" + rng.bytes(300) + b"\0" + goal[:7] + b"\0")
        time.sleep(0.5)
    assert rig.arrived(), (rig.pose, rig.driver.telemetry)
    assert rig.clearance > 0.0
    assert refused > 0 and rig.driver.telemetry.poses == len(PATH)
    rig.driver.stop()
    assert until(lambda: rig.stands, 5.0)


@IN_QEMU
def test_old_poses_and_an_emergency_stop_stop_it(rig):
    rig.connect().driver.drive_to(GOAL, STILL, PATH)
    assert until(lambda: rig.is_beyond(0.2), 60.0)
    rig.sees = False
    assert until(lambda: rig.stands, 5.0)
    assert until(lambda: rig.driver.telemetry.standing == "pose too old", 5.0)
    rig.sees = True
    assert until(lambda: rig.is_beyond(0.5), 30.0), "fresh poses have it drive on"
    rig.driver.estop()
    assert until(lambda: rig.stands, 2.0)
    assert until(lambda: "emergency stop" in rig.driver.health().faults, 5.0)
    rig.driver.send(0.2, 0.0)
    time.sleep(0.3)
    assert rig.stands
    rig.driver.release()
    assert until(lambda: rig.driver.send(0.2, 0.0) or not rig.stands, 5.0)


def remote(text):
    """Build a packet of GDB's remote protocol."""
    return f"+${text}#{sum(text.encode()) % 256:02x}".encode()


@IN_QEMU
def test_a_program_that_hangs_is_started_anew(rig, program):
    """A debugger writes a loop without end into it; its watchdog has it stand."""
    rig.connect()
    assert until(lambda: rig.driver.send(0.2, 0.0) or not rig.stands)
    # later than any clock that begins anew shows at first
    assert until(lambda: rig.driver.telemetry.uptime > 1.0)
    ask = ["arm-none-eabi-nm", program]
    names = subprocess.run(ask, capture_output=True, text=True, check=True).stdout.splitlines()
    (place,) = (line.split()[0] for line in names if line.endswith(" kmpc_host_tick"))
    with socket.create_connection(("127.0.0.1", rig.debug)) as debugger:
        time.sleep(0.2)
        debugger.sendall(remote(f"M{place},2:fee7"))
        time.sleep(0.2)
        before = rig.driver.telemetry.uptime
        debugger.sendall(remote("c"))
        assert until(lambda: rig.driver.telemetry.uptime < before, 10.0)
        assert rig.stands
        assert until(lambda: rig.driver.send(0.2, 0.0) or not rig.stands), "as after any start"


def test_a_line_without_a_board_is_reported():
    server = socket.create_server(("127.0.0.1", 0))
    url = f"tcp:127.0.0.1:{server.getsockname()[1]}"
    driver = OnboardDriver.from_options(open_transport(url), {"geometry": GEOMETRY})
    with pytest.raises(LinkError, match="running an exported controller"):
        driver.connect(0.3)
    for wrong in (
        ((math.nan, 0.0, 0.0), (), ()),
        (GOAL, [(1.0, 2.0)], ()),
        (GOAL, (), [GOAL] * 65),
    ):
        with pytest.raises(ValueError, match="finite numbers"):
            driver.drive_to(*wrong)
    driver.close()
    server.close()


def test_speeds_of_the_host_are_driven_and_do_not_last():
    """By the emulator: what a first drive records, before there is a model to export."""
    table = {"geometry": GEOMETRY}
    board = OnboardEmulator.from_options(table)
    serve_on(board, wire := named_wire("loopback:onboard"))
    driver = OnboardDriver.from_options(wire.take(board=False), table)
    driver.connect(20.0)
    assert driver.health().ready and driver.about.horizon == 20
    assert until(lambda: driver.send(0.3, 0.5) or not board.stopped)
    left, right = (speed * GEOMETRY["wheel_radius"] for speed in board.wheel_command)
    assert ((left + right) / 2, (right - left) / TRACK) == pytest.approx((0.3, 0.5), abs=1e-3)
    assert until(lambda: driver.state().v > 0.29)
    assert until(lambda: board.stopped, 5.0), "nobody says it again"
    assert until(lambda: driver.health().counters["stale_commands"] > 0)
    driver.estop()
    assert until(lambda: not driver.health().ready)
    driver.send(0.3, 0.0)
    assert board.stopped
    driver.release()
    assert until(lambda: driver.send(0.3, 0.0) or not board.stopped)
    board.reboot()
    assert until(lambda: driver.send(0.2, 0.0) or not board.stopped), "its clock begins anew"
    driver.stop()
    driver.send(0.3, 0.0)
    assert until(lambda: board.stopped) and driver.health().counters["refused_commands"] == 1
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError):
            driver.send(wrong, 0.0)
    driver.close()
    board.close()
