"""Unmodified public clients arm the emulated rover, switch it to GUIDED, drive it and stop it."""

import importlib.util
import math
import os
import re
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from free_port import free_port
from mavlink_rig import dialect, set_point_frame

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from kmpc_lab.emulator.rover.rover import RoverEmulator

WAIT = 30.0


class Listening(RoverEmulator):
    """Keeps the messages that the client sends."""

    def __init__(self) -> None:
        super().__init__(arm_after=0.2, uptime=5.0)
        self.capture = MavlinkCodec(99, 99)
        self.messages: list[dialect.MAVLink_message] = []

    def receive(self, data: bytes, stamp: float) -> None:
        self.messages += self.capture.feed(data, stamp)
        super().receive(data, stamp)


@pytest.fixture
def rover() -> Iterator[Listening]:
    emulator = Listening()
    yield emulator
    emulator.close()


def wait(condition: Callable[[], bool], what: Callable[[], str]) -> None:
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end, what()
        time.sleep(0.02)


class Client:
    """A client in a process of its own, whose words are kept."""

    def __init__(self, *command: str, home: Path) -> None:
        environment = {
            k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "DISPLAY")
        } | {"HOME": str(home), "MAVLINK20": "1"}
        self.process = subprocess.Popen(
            command,
            cwd=home,
            env=environment,
            text=True,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
        self.lines: list[str] = []
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(re.sub(r"\x1b\[[0-9;]*m", "", line.rstrip()))

    def say(self, line: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def said(self, text: str) -> bool:
        return any(text in line for line in self.lines)

    def story(self) -> str:
        return "\n".join(["the client said:", *self.lines[-40:]])

    def close(self) -> None:
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def needs(module: str, package: str) -> None:
    if importlib.util.find_spec(module) is None:
        pytest.skip(f"{package} is not installed: pip install {package}")


MAVSDK = """
import sys, time
from mavsdk import ComponentType, Configuration, Mavsdk
from mavsdk.plugins.action.action import Action
from mavsdk.plugins.offboard.offboard import Offboard, VelocityBodyYawspeed
from mavsdk.plugins.telemetry.telemetry import Telemetry
mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
mavsdk.add_any_connection(sys.argv[1])
system = mavsdk.first_autopilot(20.0)
action, offboard, telemetry = Action(system), Offboard(system), Telemetry(system)
action.arm()
offboard.set_velocity_body(VelocityBodyYawspeed(0.4, 0.0, 0.0, -15.0))
offboard.start()
print("driving", flush=True)
sys.stdin.readline()
offboard.set_velocity_body(VelocityBodyYawspeed(-0.4, 0.0, 0.0, -15.0))
print("reversing", flush=True)
sys.stdin.readline()
print("sees armed", telemetry.armed(), flush=True)
offboard.stop()
action.disarm()
print("done", flush=True)
sys.stdin.readline()
"""


def test_mavsdk(rover: Listening, tmp_path: Path) -> None:
    """Over TCP; its set-points are the capture that ours are compared with."""
    needs("mavsdk.plugins", "mavsdk>=4")
    port = free_port()
    rover.start(f"tcp:127.0.0.1:{port}")
    client = Client(sys.executable, "-u", "-c", MAVSDK, f"tcpout://127.0.0.1:{port}", home=tmp_path)
    try:
        wait(lambda: client.said("driving"), client.story)
        turn = math.radians(15.0)
        wait(lambda: rover.velocity[2] == pytest.approx(turn, abs=0.01), client.story)
        wait(lambda: math.hypot(*rover.velocity[:2]) == pytest.approx(0.4, abs=0.005), client.story)
        assert (rover.mode, rover.armed) == ("GUIDED", True)
        assert rover.pose[0] > 0.1
        assert rover.pose[2] > 0.1, "a negative yaw speed turns to the left"
        client.say("")
        wait(lambda: client.said("reversing"), client.story)
        wait(
            lambda: (
                rover.velocity[0] * math.cos(rover.pose[2])
                + rover.velocity[1] * math.sin(rover.pose[2])
                < -0.39
                and rover.velocity[2] == pytest.approx(turn, abs=0.01)
            ),
            client.story,
        )
        client.say("")
        wait(lambda: client.said("done"), client.story)
        assert client.said("sees armed True")
        wait(lambda: rover.mode == "HOLD" and not rover.armed and rover.stopped, client.story)
    finally:
        client.close()
    captured = [m for m in rover.messages if m.get_type() == "SET_POSITION_TARGET_LOCAL_NED"]
    assert len(captured) > 20
    for theirs in (captured[0], captured[-1]):
        frame, header = bytes(theirs.get_msgbuf()), theirs.get_header()
        ours = set_point_frame(
            theirs.time_boot_ms,
            theirs.vx,
            -theirs.yaw_rate,
            header.seq,
            header.srcSystem,
            header.srcComponent,
        )
        assert frame == ours, "mavsdk and the driver say the same in the same bytes"
    assert rover.counters["bad_data"] == 0
    assert rover.counters["aborts"] == 0
