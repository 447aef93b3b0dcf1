"""Cars and omnis on motor boards: what is sent, how they move, faults, and whole drives."""

import math
import struct

import pytest
from boards import DRIVERS, EMULATORS, Spy
from waiting import until

from firmware_bridge.drivers.vesc import SET_SERVO_POS
from firmware_bridge.link import open_transport
from firmware_bridge.link.framing import VescPackets
from firmware_bridge.messages import ConfigError, LinkError
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.session import open_driver
from kmpc_lab.emulator.build import build_emulator

SIZES = {"wheel_radius": 0.05, "max_wheel_speed": 1.0}
CAR = {**SIZES, "wheelbase": 0.26, "steering_angle": 0.5}
MECANUM = {**SIZES, "track": 0.3, "wheelbase": 0.25, "invert": [2, 4]}
SLOW = {"watchdog": 5.0, "command_timeout": 2.0}
"""Watchdogs that a busy machine does not trip: others are tested with every board."""
COUNTS = {"counts_per_turn": 1440, **SLOW}
ROBOTS = {
    "vesc car": ("vesc", "car", CAR, {"pole_pairs": 7}),
    "arduino car": ("arduino", "car", CAR, COUNTS),
    "arduino mecanum": ("arduino", "omni", MECANUM, COUNTS),
    "arduino three": ("arduino", "omni", {**SIZES, "arm": 0.15}, COUNTS),
}


def sections(name):
    driver, kind, geometry, board = ROBOTS[name]
    link = {"url": "pty:link", "driver": driver}
    return {
        "link": link,
        "robot": {"wheels": kind},
        "geometry": geometry,
        "board": board,
        "limits": {"v_max": 0.4, "v_reverse": 0.4, "omega_max": 1.2},
    }


@pytest.fixture
def robot(tmp_path, monkeypatch):
    """A driver and an emulator of a robot, connected."""
    monkeypatch.chdir(tmp_path)
    opened = []

    def made(name):
        told = load_robot(None, sections(name))
        emulator = build_emulator(told, (0.0, 0.0, 0.0), 0.0, 1.0, 0, 0.1)
        emulator.start("pty:link")
        opened.append(emulator)
        driver = open_driver(told, open_transport("pty:link"))
        opened.insert(0, driver)
        driver.connect(20.0)
        return driver, emulator

    yield made
    for one in opened:
        one.close()


def drive(driver, emulator, command, way):
    """Command until the robot has gone or turned so far, then until it stands."""

    def gone():
        driver.send(*command)
        x, y, theta = emulator.pose
        return math.hypot(x, y) + 0.2 * abs(theta) > way

    assert until(gone)
    assert until(lambda: driver.send(0.0, 0.0) or emulator.stopped)
    here = None

    def rests():
        nonlocal here
        before, here = here, driver.state()
        driver.send(0.0, 0.0)
        return before is not None and (before.x, before.y, before.theta) == (
            here.x, here.y, here.theta,
        ) and before.stamp < here.stamp  # fmt: skip

    assert until(rests)
    return emulator.pose


@pytest.mark.parametrize("name", [name for name in ROBOTS if ROBOTS[name][1] == "omni"])
def test_an_omni_drives_to_the_left_and_knows_where_it_is(robot, name):
    driver, emulator = robot(name)
    x, y, theta = drive(driver, emulator, (0.0, 0.0, 0.3), 0.15)
    assert y > 0.12 and abs(x) < 0.02 and abs(theta) < 0.05
    state = driver.state()
    assert (state.x, state.y, state.theta) == pytest.approx((x, y, theta), abs=0.01)
    drive(driver, emulator, (0.2, 0.8, -0.1), 0.25)
    (x, y, theta), state = emulator.pose, driver.state()
    assert (state.x, state.y, state.theta) == pytest.approx((x, y, theta), abs=0.02)
    assert driver.health().ready and driver.health().faults == ()


@pytest.mark.parametrize("name", ["vesc car", "arduino car"])
def test_a_cars_wheels_turn_where_it_stands_and_stay_when_it_stops(robot, name):
    driver, emulator = robot(name)
    assert until(lambda: driver.send(0.0, 0.5) or emulator._body._curvature > 2.0)
    assert math.dist(emulator.pose, (0.0, 0.0, 0.0)) == 0.0
    x, y, theta = drive(driver, emulator, (0.2, 0.4), 0.4)
    radius = 0.5
    assert theta > 0.3 and y == pytest.approx(radius * (1 - math.cos(theta)), abs=0.04)
    assert emulator._body._curvature == pytest.approx(2.0, abs=0.01), "as they were steered"
    state = driver.state()
    assert (state.x, state.y, state.theta) == pytest.approx((x, y, theta), abs=0.05)


def test_a_vescs_servo_is_commanded_by_its_own_bytes(loopback):
    """COMM_SET_SERVO_POS of bldc's commands.c: 12, then int16 of a thousand times the position."""
    table = {"wheels": "car", "geometry": CAR, "board": {"pole_pairs": 7, "servo_left": 0.8}}
    emulator = EMULATORS["vesc"].from_options(table)
    emulator.start(loopback)
    wire = Spy(open_transport(loopback))
    driver = DRIVERS["vesc"].from_options(wire, table)
    driver.connect(20.0)
    sharpest = math.tan(0.5) / 0.26
    for command, position in (((0.2, 0.2 * sharpest), 800), ((-0.2, 0.2 * sharpest), 200)):
        wire.frames.clear()
        driver.send(*command)
        assert until(lambda: wire.frames)
        payloads = [p for f in wire.frames for p in VescPackets().feed(f, 0.0)]
        servo = [p for p in payloads if p[0] == SET_SERVO_POS]
        assert servo[0] == struct.pack(">Bh", 12, position)
        assert not any(p[0] == 34 for p in payloads), "no second VESC"
    driver.close()
    emulator.close()


@pytest.fixture
def loopback(tmp_path):
    return f"pty:{tmp_path}/link"


@pytest.mark.parametrize(
    ("name", "change", "words"),
    [
        ("vesc car", {"board": {"can_id": 3}}, "board.can_id: a car has one motor"),
        ("vesc car", {"geometry": {"wheelbase": None}}, "robot.wheels.turning_radius: missing"),
        ("arduino mecanum", {"geometry": {"track": None}}, "expected track and wheelbase of mec"),
        ("arduino mecanum", {"geometry": {"invert": [5]}}, "geometry.invert: expected numbers"),
    ],
)
def test_what_does_not_fit_together_is_refused_in_one_line(name, change, words):
    told = sections(name)
    for section, keys in change.items():
        kept = {k: v for k, v in {**told[section], **keys}.items() if v is not None}
        told[section] = {**kept, **({"steering_angle": 0.5} if "wheelbase" in keys else {})}
    if words.startswith("robot.wheels.turning"):
        told["robot"] = {"wheels": {"kind": "car"}}
    with pytest.raises(ConfigError, match=words) as error:
        open_driver(load_robot(None, told), open_transport("pty:link"))
    assert "\n" not in str(error.value)


def test_a_sketch_of_other_wheels_is_refused(tmp_path):
    url = f"pty:{tmp_path}/link"
    emulator = EMULATORS["arduino"].from_options(
        {"geometry": {**SIZES, "track": 0.3}, "board": {"counts_per_turn": 1440}}
    )
    emulator.start(url)
    table = {"wheels": "omni", "geometry": MECANUM, "board": {"counts_per_turn": 1440}}
    driver = DRIVERS["arduino"].from_options(open_transport(url), table)
    with pytest.raises(LinkError, match="2 motors and 0 servos, expected 4 and 0: KMPC_MOTORS"):
        driver.connect(1.0)
    emulator.close()
