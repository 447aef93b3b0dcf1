"""Lidar drivers against their emulators over pseudo-terminals: what they see, and every fault."""

from __future__ import annotations

import time

import numpy as np
import pytest
from lidars import lidar_pair
from waiting import until

from firmware_bridge.link.serial_port import SerialEndpoint
from firmware_bridge.messages import ConfigError, LinkError, State
from firmware_bridge.robot_file import load_robot
from firmware_bridge.sensors.lidar.kinds import lidar_transport, open_lidar
from firmware_bridge.sensors.lidar.options import LidarOptions
from firmware_bridge.sensors.sight import make_scan

KINDS = ("rplidar", "ld06")


@pytest.fixture(params=KINDS)
def pair(request, tmp_path, monkeypatch):
    monkeypatch.setattr("firmware_bridge.sensors.lidar.lidar.SILENCE", 0.4)
    monkeypatch.setattr("firmware_bridge.sensors.lidar.lidar.RATE_AGE", 0.6)
    with lidar_pair(request.param, tmp_path / "lidar") as both:
        both[0].connect(10.0)
        yield both


def newer(lidar):
    """Wait for a turn that began after now."""
    now = time.monotonic()
    return until(lambda: lidar.sweep() is not None and lidar.sweep().stamps.min() > now)


def silent(lidar):
    """Whether no new turn comes."""
    last = lidar.sweep()
    time.sleep(0.5)
    return lidar.sweep() is last


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize("driver", KINDS)
def test_it_sees_what_is_there(driver, mirrored, tmp_path):
    mount = (0.1, -0.05, 2.0)
    with lidar_pair(driver, tmp_path / "l", mount=mount, mirrored=mirrored) as (lidar, _):
        lidar.connect(10.0)
        sweep = lidar.sweep()
        poses = np.zeros((len(sweep.angles) + 1, 3))
        options = LidarOptions(driver, "pty:x", mount=mount, mirrored=mirrored, no_return="free")
        scan = make_scan(options, sweep, poses, State(0.0, 0.0, 0.0, 0.0, 0.0, sweep.stamp))
        hit = np.isfinite(scan.ranges)
        x = scan.mount[0] + scan.ranges[hit] * np.cos(scan.angles[hit] + scan.mount[2])
        y = scan.mount[1] + scan.ranges[hit] * np.sin(scan.angles[hit] + scan.mount[2])
        circles = ((2.0, 0.0, 0.5), (0.0, -1.5, 0.3), (-1.0, 1.0, 0.2))
        off = np.min([np.abs(np.hypot(x - cx, y - cy) - r) for cx, cy, r in circles], axis=0)
        assert hit.sum() > 60 and np.median(off) < 0.02 and np.quantile(off, 0.95) < 0.12
        health = lidar.health()
        assert health.connected and not health.faults and health.rate > 0.0
        # a busy machine loses bytes, but not in every turn
        bad = [lidar.health().counters["bad_bytes"] for _ in range(8) if newer(lidar)]
        assert min(np.diff(bad)) == 0


@pytest.mark.parametrize("fault", [{"lost": 0.002}, {"wrong": 0.002}, {"garbage": 0.003}])
def test_bytes_that_are_lost_wrong_or_too_many_cost_few_beams(pair, fault):
    lidar, emulator = pair
    for name, value in fault.items():
        setattr(emulator.faults, name, value)
    assert until(lambda: newer(lidar) and lidar.health().counters["bad_bytes"] > 0)
    assert lidar.health().counters["internal_errors"] == 0
    sweep = lidar.sweep()
    hit = sweep.ranges[np.isfinite(sweep.ranges)]
    # nothing in this world is nearer than that, nor farther
    strange = (hit < 0.9) | (hit > 2.4)
    assert len(hit) > 30 and strange.mean() < 0.1


def test_a_stuck_motor_gives_no_turn_and_is_reported(pair):
    lidar, emulator = pair
    emulator.faults.stuck = True
    time.sleep(0.3)
    assert silent(lidar)
    assert until(lambda: "motor" in "".join(lidar.health().faults))
    emulator.faults.stuck = False
    assert newer(lidar)


def test_it_comes_back_after_the_plug_was_pulled(pair, tmp_path):
    lidar, emulator = pair
    emulator.close()
    assert until(lambda: not lidar.health().connected)
    assert "lost" in "".join(lidar.health().faults)
    emulator.start(f"pty:{tmp_path / 'lidar'}")
    assert newer(lidar) and lidar.health().counters["reconnects"] == 1


@pytest.mark.parametrize(("driver", "words"), [("rplidar", "115200"), ("ld06", "230400")])
def test_a_wrong_baud_rate_is_reported(driver, words, tmp_path):
    with lidar_pair(driver, tmp_path / "l") as (lidar, emulator):
        # no byte as it was: half of them right would pass a checksum now and then
        emulator.faults.wrong, emulator.faults.garbage = 1.0, 0.5
        if driver == "rplidar":
            emulator.scanning = True
        with pytest.raises(LinkError, match=f"no turn within 1.5 s: .*baud.*{words}"):
            lidar.connect(1.5)


def test_a_missing_lidar_is_reported(tmp_path):
    with lidar_pair("ld06", tmp_path / "l") as (lidar, emulator):
        emulator.faults.mute = True
        with pytest.raises(LinkError, match="no byte: is it powered"):
            lidar.connect(0.3)
    options = LidarOptions("ld06", f"pty:{tmp_path / 'nothing'}")
    with pytest.raises(LinkError, match="no such port"):
        open_lidar(options).connect(0.3)


def test_an_rplidar_that_reports_an_error_is_reported_and_restarted_once_it_is_well(tmp_path):
    with lidar_pair("rplidar", tmp_path / "l") as (lidar, emulator):
        emulator.health = (2, 0x8001)
        with pytest.raises(LinkError, match=r"reports an error \(code 32769\)"):
            lidar.connect(0.7)
    with lidar_pair("rplidar", tmp_path / "m") as (lidar, emulator):
        emulator.health = (1, 7)
        lidar.connect(10.0)
        assert "warning (code 7)" in lidar.notes()[0]
        assert lidar.health().name == "RPLIDAR A1M8, firmware 1.29" and emulator.pwm == 0


def test_an_a2_has_its_motor_turned_and_stopped_by_pwm(tmp_path):
    with lidar_pair("rplidar", tmp_path / "l") as (lidar, emulator):
        emulator.kind = 0x28
        lidar.connect(10.0)
        assert emulator.pwm == 660 and "A2M8" in lidar.health().name
        lidar.close()
        assert until(lambda: emulator.pwm == 0 and not emulator.scanning)


def test_a_serial_line_is_set_to_the_lidar_unless_given(monkeypatch):
    made = []
    monkeypatch.setattr(
        "firmware_bridge.link.serial_port.SerialEndpoint",
        lambda *how: made.append(how) or SerialEndpoint(*how),
    )
    for driver, link in (
        ("rplidar", "serial:/dev/ttyUSB0"),
        ("rplidar", "serial:/dev/ttyUSB0?dtr=1"),
        ("ld06", "/dev/ttyUSB1"),
        ("ld06", "serial:/dev/ttyUSB1?baud=115200"),
    ):
        lidar_transport(LidarOptions(driver, link))
    assert [how[1:] for how in made] == [
        (115200, True, False),
        (115200, True, True),
        (230400, True, None),
        (115200, True, None),
    ]
    with pytest.raises(ConfigError, match="dtr"):
        lidar_transport(LidarOptions("rplidar", "serial:/dev/ttyUSB0?dtr=2"))


BASE = {"driver": "ld06", "link": "serial:/dev/ttyUSB0"}
LINK = {"url": "tcp:127.0.0.1:1", "driver": "mavlink"}


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"driver": "sick"}, "lidar.driver: expected rplidar, ld06, got 'sick'"),
        ({"link": "usb:0"}, "link: expected serial:"),
        ({"link": None}, "lidar.link: missing: give --lidar-link URL"),
        ({"mount": [1, 2]}, "lidar.mount: expected .x, y, theta. in m, rad"),
        ({"ignore": [1, 2]}, "lidar.ignore"),
        ({"ignore": [[0, 1]] * 65}, "lidar.ignore"),
        ({"beams": 10}, "lidar.beams: expected 36 to 1440"),
        ({"no_return": "maybe"}, "lidar.no_return: expected unknown or free"),
        ({"range_min": 2, "range_max": 1}, "lidar.range_max: expected more than range_min"),
    ],
)
def test_what_is_wrong_is_reported_in_one_line(more, words):
    with pytest.raises(ConfigError, match=words) as told:
        table = {k: v for k, v in {**BASE, **more}.items() if v is not None}
        load_robot(None, {"link": LINK, "lidar": table})
    assert "\n" not in str(told.value)


def test_a_lidar_is_named():
    with pytest.raises(ConfigError, match="lidar.driver: missing: give --lidar NAME"):
        load_robot(None, {"link": LINK, "lidar": {"link": "pty:x"}})
    assert load_robot(None, {"link": LINK}).lidar is None
