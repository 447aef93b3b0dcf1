"""The driver as the bridge uses it: threads, real ports, real time."""

import math
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from free_port import free_port
from rover_link import READY

from firmware_bridge.drivers.mavlink.driver import MavlinkDriver
from firmware_bridge.link import open_transport
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
