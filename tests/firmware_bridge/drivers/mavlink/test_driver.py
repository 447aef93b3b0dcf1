"""The driver as the bridge uses it: threads, real ports, real time."""

from __future__ import annotations

import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from free_port import free_port
from mavlink_rig import decode, set_point_frame
from rover_link import READY

from firmware_bridge.drivers.mavlink.driver import MavlinkDriver
from firmware_bridge.link import OnBytes, open_transport
from kmpc_lab.emulator.rover.parameters import MOTION_CAPTURE
from kmpc_lab.emulator.rover.rover import RoverEmulator


@pytest.fixture(params=["udp", "pty"])
def url(request: pytest.FixtureRequest, tmp_path: Path) -> str:
    if request.param == "pty":
        return f"pty:{tmp_path / 'rover'}"
    kind = socket.SOCK_STREAM if request.param == "tcp" else socket.SOCK_DGRAM
    return f"{request.param}:127.0.0.1:{free_port(kind)}"


def wait(condition: Callable[[], bool], limit: float = 30.0) -> None:
    end = time.monotonic() + limit
    while not condition():
        assert time.monotonic() < end, f"not within {limit} s"
        time.sleep(0.005)


def drive(driver: MavlinkDriver, v: float, omega: float, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        driver.send(v, omega)
        time.sleep(0.02)


def drive_until(
    driver: MavlinkDriver, v: float, omega: float, condition: Callable[[], bool]
) -> None:
    """Send a command until something has come of it: on a busy machine that takes longer."""

    def sent() -> bool:
        driver.send(v, omega)
        return condition()

    wait(sent)


def started(url: str, closing: Callable[..., None], **options: Any) -> RoverEmulator:
    """A rover that is ready to drive, at a link."""
    rover = RoverEmulator(**{**READY, **options})
    closing(rover)
    rover.start(url)
    return rover


def taken(url: str, closing: Callable[..., None], **board: Any) -> MavlinkDriver:
    """A driver that has armed what is at a link."""
    table = {"board": {"arm": True, **board}}
    driver = MavlinkDriver.from_options(open_transport(url), table)
    closing(driver)
    driver.connect(20.0)
    wait(lambda: driver.health().ready)
    return driver


def test_over_every_link(url: str, closing: Callable[..., None]) -> None:
    """Found, taken, driven, stopped, given back."""
    rover, driver = started(url, closing), taken(url, closing)
    drive(driver, 0.4, 0.3, 1.2)
    driver.stop()
    wait(lambda: rover.mode == "HOLD" and rover.stopped)
    x, y, theta = rover.pose
    assert x > 0.15
    assert theta > 0.15
    wait(lambda: (at := driver.state()) is not None and math.hypot(at.x - x, at.y - y) < 0.05)
    driver.close()
    driver.close()
    wait(lambda: rover.stopped)
    assert rover.counters["aborts"] == 0
    assert rover.counters["internal_errors"] == 0
    assert driver.health().counters["internal_errors"] == 0


def test_close_stops_a_rover_that_moves_by_our_word(tcp: str, closing: Callable[..., None]) -> None:
    rover, driver = started(tcp, closing), taken(tcp, closing)
    drive(driver, 0.4, 0.0, 0.5)
    driver.close()
    assert rover.mode == "HOLD", "close has waited for the confirmation"


def test_close_leaves_alone_what_it_did_not_move(tcp: str, closing: Callable[..., None]) -> None:
    rover = started(tcp, closing)
    wait(lambda: rover.pilot_mode(15))
    rover.pilot_arm()
    driver = MavlinkDriver(open_transport(tcp))
    closing(driver)
    driver.connect(20.0)
    wait(lambda: driver.health().ready)
    driver.close()
    time.sleep(0.1)
    assert (rover.mode, rover.armed) == ("GUIDED", True)


def test_motion_capture(tcp: str, closing: Callable[..., None]) -> None:
    """Poses from a thread of their own; the robot is taken later, by hand."""
    rover = started(tcp, closing, parameters=MOTION_CAPTURE, pose=(1.0, 2.0, 0.5))
    driver = MavlinkDriver.from_options(
        open_transport(tcp), {"board": {"pose": "mocap", "origin": [47.0, 8.0, 400.0]}}
    )
    closing(driver)
    quit_feeding = threading.Event()

    def feed() -> None:
        while not quit_feeding.wait(0.02):
            driver.feed_pose(*rover.pose, time.monotonic())

    feeder = threading.Thread(target=feed, daemon=True)
    feeder.start()
    try:
        driver.connect(20.0)
        wait(lambda: driver.state() is not None)
        state = driver.state()
        assert state is not None
        assert (state.x, state.y, state.theta) == pytest.approx((1.0, 2.0, 0.5), abs=1e-5)
        assert not driver.health().ready
        driver.take()
        wait(lambda: driver.health().ready)
        assert "Throttle armed" in driver.notes()
        drive(driver, 0.3, 0.0, 0.5)
    finally:
        quit_feeding.set()
        feeder.join()
    wait(lambda: time.monotonic() - driver.health().pose_stamp > 0.3)
    state = driver.state()
    assert state is not None
    assert state.stamp > driver.health().pose_stamp + 0.1


def test_a_signed_link(tcp: str, tmp_path: Path, closing: Callable[..., None]) -> None:
    key = tmp_path / "key"
    key.write_text(bytes(range(32)).hex())
    key.chmod(0o600)
    rover = started(tcp, closing, key=bytes(range(32)))
    driver = taken(tcp, closing, key_file=str(key))
    drive_until(driver, 0.3, 0.0, lambda: rover.counters["set_points"] > 10)
    assert rover.counters["unsigned"] == 0


def test_unplugged_and_plugged_in_again(tcp: str, closing: Callable[..., None]) -> None:
    """The vehicle keeps its mode; telemetry is asked for again by itself."""
    first, driver = started(tcp, closing), taken(tcp, closing)
    first.close()
    wait(lambda: not driver.health().connected)
    driver.send(0.2, 0.0)
    driver.stop()
    started(tcp, closing)
    wait(lambda: driver.health().connected)
    unplugged = time.monotonic()
    wait(lambda: driver.state() is not None and driver.state().stamp > unplugged)  # type: ignore[union-attr]
    assert driver.health().counters["reconnects"] == 1
    wait(lambda: not driver.health().ready)


def test_no_exception_leaves_the_io_thread_and_none_is_kept_quiet(
    tcp: str, closing: Callable[..., None]
) -> None:
    started(tcp, closing)
    driver = MavlinkDriver(open_transport(tcp))
    closing(driver)
    driver.connect(20.0)

    def broken(*_: object) -> None:
        raise RuntimeError("a bug")

    driver._core.pose.on_attitude = broken  # type: ignore[method-assign]
    wait(lambda: driver.health().counters["internal_errors"] > 3)
    health = driver.health()
    assert health.connected
    assert "internal error: RuntimeError: a bug" in health.faults


class Tape:
    """A transport that keeps what is written, and lets tests put bytes in."""

    connected = True
    counters: dict[str, int] = {}
    last_error = ""

    def __init__(self) -> None:
        self.written: list[bytes] = []
        self.on_bytes: OnBytes | None = None

    def start(self, on_bytes: OnBytes) -> None:
        self.on_bytes = on_bytes

    def write(self, data: bytes) -> bool:
        self.written.append(data)
        return True

    def close(self) -> None:
        return


def test_set_points_on_the_wire_byte_for_byte(closing: Callable[..., None]) -> None:
    """One whole frame per write, as an encoder of the test's own makes it."""
    tape = Tape()
    driver = MavlinkDriver(tape, clock=lambda: 12.345)
    driver.send(0.0, 0.0)
    assert tape.written == [set_point_frame(12345, 0.0, 0.0)]
    with pytest.raises(ValueError, match="finite"):
        driver.send(math.nan, 0.0)
    assert len(tape.written) == 1
    (message,) = decode(tape.written)
    assert (
        message.type_mask,
        message.coordinate_frame,
        message.target_system,
        message.target_component,
    ) == (0x5C7, 8, 1, 1)  # type: ignore[attr-defined]


DRIVE_FOR_EVER = """
import sys, time
from firmware_bridge.drivers.mavlink.driver import MavlinkDriver
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.link import open_transport
driver = MavlinkDriver(open_transport(sys.argv[1]), MavlinkOptions(arm=True))
driver.connect(10.0)
while not driver.health().ready:
    time.sleep(0.01)
while True:
    driver.send(0.5, 0.0)
    time.sleep(0.02)
"""


def test_kill_9_the_rover_stops_by_its_own_time_out(tcp: str, closing: Callable[..., None]) -> None:
    rover = started(tcp, closing)
    root = str(Path(__file__).parents[4])
    child = subprocess.Popen(
        [sys.executable, "-c", DRIVE_FOR_EVER, tcp],
        cwd=root,
        env={**os.environ, "PYTHONPATH": root},
    )
    try:
        wait(lambda: rover.velocity[0] > 0.45, 20.0)
    finally:
        child.send_signal(signal.SIGKILL)
        child.wait()
    x = rover.pose[0]
    wait(lambda: rover.stopped)
    assert rover.pose[0] - x > 0.7, "until the time-out, of three seconds, it drives on"
    assert rover.counters["timeouts"] == 1
