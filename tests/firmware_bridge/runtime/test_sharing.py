"""A drive of the emulated rover that ground stations watch, and into which they speak."""

import importlib.util
import math
import os
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from free_port import free_port
from pymavlink.dialects.v20 import ardupilotmega as dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, VelocityCommand
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import Session
from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.emulator.rover.rover import RoverEmulator


def robot(tmp_path: Path, *stations: str, **more: object):
    sections = {
        "link": {
            "url": f"pty:{tmp_path}/rover",
            "driver": "mavlink",
            "forward": " ".join(stations) or None,
            "timeout": 30.0,
        },
        "board": {"arm": True},
        "safety": {"socket": str(tmp_path / "estop")},
        **more,
    }
    return load_robot(None, sections)


class Station:
    """A ground station that says what a test hands to it."""

    def __init__(self, port: int) -> None:
        self.link = open_transport(f"udp:127.0.0.1:{port}?listen=1")
        self.codec, self.heard = MavlinkCodec(255, 190), []
        self.link.start(lambda data, now: self.heard.extend(self.codec.feed(data, now)))

    def say(self, message) -> None:
        self.link.write(self.codec.encode(message))

    def has(self, kind: str, **values) -> bool:
        return any(
            m.get_type() == kind and all(getattr(m, k) == v for k, v in values.items())
            for m in list(self.heard)
        )


def wait(condition, seconds: float = 40.0) -> None:
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.02)


def drive_beside(session: Session, speak) -> None:
    """Drive, signals being the main thread's, while another thread speaks for a station."""
    failed: list[BaseException] = []
    done = threading.Event()

    def run() -> None:
        try:
            speak()
        except BaseException as error:
            failed.append(error)
        done.set()

    threading.Thread(target=run, daemon=True).start()
    until = time.monotonic() + 120.0
    session.drive(lambda: done.is_set() or time.monotonic() > until)
    if failed:
        raise failed[0]


def ahead(state) -> VelocityCommand:
    return VelocityCommand(0.2, 0.0, time.monotonic())


def test_only_an_autopilot_is_shared(tmp_path):
    with pytest.raises(ConfigError, match="forward"):
        load_robot(
            None,
            {"link": {"url": "pty:/x", "driver": "roboclaw", "forward": "udp:127.0.0.1:14550"}},
        )
    with pytest.raises(ConfigError, match="link"):
        robot(tmp_path, "carrier-pigeon:1")


def test_a_station_sees_the_vehicle_is_refused_set_points_and_takes_it_over_by_mode(tmp_path):
    rover = RoverEmulator(arm_after=0.2, uptime=5.0)
    number = free_port(socket.SOCK_DGRAM)
    station = Station(number)
    rover.start(f"pty:{tmp_path}/rover")
    try:
        with Session(robot(tmp_path, f"udp:127.0.0.1:{number}"), ahead, 0.1) as session:
            told: list[str] = []

            def speak() -> None:
                wait(lambda: session.gate.state is GateState.ACTIVE)
                wait(lambda: station.has("LOCAL_POSITION_NED") and station.has("HEARTBEAT"))
                station.say(dialect.MAVLink_param_request_read_message(1, 1, b"WP_SPEED", -1))
                wait(lambda: station.has("PARAM_VALUE", param_id="WP_SPEED"))
                station.say(
                    dialect.MAVLink_set_position_target_local_ned_message(
                        1, 1, 1, 8, 0x5C7, 0, 0, 0, -0.5, 0, 0, 0, 0, 0, 0, 1.0
                    )
                )
                wait(lambda: session.shared.refused)
                wait(lambda: any("kmpc refused" in str(m) for m in station.heard))
                assert session.gate.state is GateState.ACTIVE and session.refused()
                assert rover.velocity[0] >= -0.05 and abs(rover.pose[2]) < 0.2
                station.say(dialect.MAVLink_command_long_message(1, 1, 176, 0, 1, 0, *[0.0] * 5))
                wait(lambda: session.gate.state is GateState.YIELDED)
                assert rover.mode == "MANUAL"
                station.say(dialect.MAVLink_manual_control_message(1, 500, 0, 500, 0, 0))
                wait(lambda: session.driver.health().counters["stations_passed"] >= 3)
                told.append("all")

            drive_beside(session, speak)
            assert told == ["all"]
            assert session.driver.health().counters["stations_refused"] == 1
    finally:
        station.link.close()
        rover.close()


@pytest.mark.long
def test_mavproxy_shares_a_vehicle_that_the_bridge_drives(tmp_path):
    if importlib.util.find_spec("MAVProxy") is None:
        pytest.skip("MAVProxy is not installed: pip install mavproxy")
    rover = RoverEmulator(arm_after=0.2, uptime=5.0)
    number = free_port(socket.SOCK_DGRAM)
    rover.start(f"pty:{tmp_path}/rover")
    script = Path(sys.executable).parent / "mavproxy.py"
    words = (
        f"--master=udpin:127.0.0.1:{number}",
        f"--state-basedir={tmp_path}",
        "--default-modules=cmdlong,mode,arm,param,rc",
    )
    environment = {k: v for k, v in os.environ.items() if k not in ("PYTHONPATH", "DISPLAY")}
    client = subprocess.Popen(
        [sys.executable, "-u", str(script), *words],
        env={**environment, "HOME": str(tmp_path), "MAVLINK20": "1"},
        cwd=tmp_path,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
    )
    lines: list[str] = []
    threading.Thread(target=lambda: lines.extend(client.stdout), daemon=True).start()  # type: ignore[arg-type]

    def said(text: str) -> bool:
        return any(text in line for line in list(lines))

    def say(line: str) -> None:
        assert client.stdin is not None
        client.stdin.write(line + "\n")
        client.stdin.flush()

    seen: list[str] = []
    try:
        with Session(robot(tmp_path, f"udp:127.0.0.1:{number}"), ahead, 0.1) as session:

            def speak() -> None:
                wait(lambda: said("online system 1"))
                wait(lambda: said("Received ") and said(" parameters"))
                seen.append("parameters")
                wait(lambda: session.gate.state is GateState.ACTIVE)
                for _ in range(5):
                    say("velocity -0.5 0.5 0")
                    time.sleep(0.2)
                wait(lambda: said("kmpc refused SET_POSITION_TARGET_LOCAL_NED"))
                assert session.gate.state is GateState.ACTIVE
                rate = session.driver.health().counters["streams_lowered"]
                assert abs(math.degrees(rover.pose[2])) < 20.0
                say("param set WP_SPEED 0.4")
                wait(lambda: abs(rover.parameters["WP_SPEED"] - 0.4) < 1e-3)
                say("mode HOLD")
                wait(lambda: session.gate.state is GateState.YIELDED)
                seen.append(f"taken over, streams lowered {rate} times")

            drive_beside(session, speak)
        assert len(seen) == 2, "".join(lines)[-3000:]
    finally:
        client.kill()
        client.wait()
        rover.close()
