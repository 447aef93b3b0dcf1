"""Every serial board drives as commanded, within its limits, over real descriptors."""

import math
import time

import pytest
from boards import Rig, distance, with_board
from free_port import free_port
from waiting import until


@pytest.fixture(params=["pty", "tcp"])
def url(request, tmp_path):
    return f"pty:{tmp_path}/port" if request.param == "pty" else f"tcp:127.0.0.1:{free_port()}"


def test_drives_and_reads_back(name, url):
    rig = Rig(name, url).connect()
    try:
        assert rig.driver.health().ready and rig.driver.health().faults == ()

        def as_told():
            rig.driver.send(0.4, 0.5)
            state = rig.driver.state()
            return abs(state.v - 0.4) < 0.02 and abs(state.omega - 0.5) < 0.1

        assert until(as_told, 60.0)
        rig.drive(0.4, 0.5, 0.3)
        now = time.monotonic()
        assert until(lambda: rig.driver.state().stamp > now)
        rig.drive(-0.3, -1.0, 0.2)
        rig.driver.send(0.0, 0.0)
        assert until(lambda: abs(rig.driver.state().v) < 1e-3)
        assert until(
            lambda: all(
                a < b for a, b in zip(distance(rig.driver, rig.emulator), (0.01, 0.03), strict=True)
            )
        ), distance(rig.driver, rig.emulator)
        assert math.hypot(*rig.emulator.pose[:2]) > 0.05
        counters = rig.counters
        assert counters["frames"] > 10
        assert counters["driver_errors"] == 0
        # an answer that a busy machine gave too late is one that is not awaited any more, whole
        # or in parts
        assert counters["bad_bytes"] == 0 or counters["timeouts"]
        assert counters["unexpected_replies"] <= counters["timeouts"]
    finally:
        rig.close()


@pytest.mark.parametrize("command", [(math.nan, 0.0), (0.1, math.inf), (-math.inf, math.nan)])
def test_non_finite_commands_never_reach_the_wire(rig, command):
    rig.connect()
    rig.driver.send(0.0, 0.0)
    assert until(lambda: not rig.driver._held.pending)
    rig.driver._held.zeros = 0
    with pytest.raises(ValueError, match="finite"):
        rig.driver.send(*command)
    held = rig.driver._held
    assert not held.pending and held.value == (0.0, 0.0) and rig.emulator.stopped


def test_commands_are_scaled_to_the_wheel_limit(rig):
    rig.connect()
    rig.drive(50.0, 40.0, 0.2)
    rig.starts(50.0, 40.0)
    left, right = rig.emulator.wheel_command
    rim = 0.0425 * max(abs(left), abs(right))
    assert rim == pytest.approx(0.9, rel=1e-3)
    v, omega = 0.0425 * (left + right) / 2, 0.0425 * (right - left) / 0.27
    assert omega / v == pytest.approx(40.0 / 50.0, rel=1e-2)


def test_stop_releases_and_only_zero_takes_back(rig):
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.driver.stop()
    assert until(lambda: rig.emulator.stopped) and not rig.driver.health().ready
    rig.driver.send(0.3, 0.0)
    time.sleep(0.1)
    assert rig.emulator.stopped and rig.counters["refused_commands"] >= 1
    rig.is_ready()
    rig.starts(0.3, 0.0)


def test_an_old_command_is_replaced_by_zero_while_the_driver_lives(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port", with_board(name, command_timeout=0.15)).connect()
    try:
        rig.driver.send(0.3, 0.0)
        assert until(lambda: not rig.emulator.stopped) and until(lambda: rig.emulator.stopped)
        assert rig.counters["stale_commands"] == 1 and rig.driver.health().ready
    finally:
        rig.close()
