"""The digital twin on other wheels: a car, and a robot that drives sideways."""

import math

import numpy as np
import pytest

from firmware_bridge.kinematics import CarGeometry, OmniGeometry, WheelGeometry
from firmware_bridge.messages import ConfigError, command_of
from kmpc_lab.emulator.twin import TwinBody
from kmpc_lab.sim.twin import Twin
from kmpc_lab.sim.twin.vehicles import VEHICLES, front_wheels
from kmpc_lab.studies.robot_drives import drive_random
from kmpc_lite import Circle
from kmpc_lite.control.path.motions import seen_from
from kmpc_lite.scenario.files import Scenario


def moved(twin: Twin, *command: float, seconds: float = 1.0) -> np.ndarray:
    """How far it drives ahead, to the left and round in a time, once it has begun."""
    twin.command(*command)
    twin.advance(1.0)
    before = np.array(twin.pose)
    twin.advance(seconds)
    return seen_from(before, np.array([twin.pose]))[0]


def test_rollers_carry_it_sideways_and_slip_as_they_do():
    left = moved(Twin(wheels="omni"), 0.0, 0.0, 0.3)
    assert 0.25 < left[1] < 0.295 and abs(left[0]) < 0.01 and abs(left[2]) < 0.02
    twin = Twin(wheels="omni")
    turn = moved(twin, 0.0, 1.0)
    assert turn[2] == pytest.approx(1.0, abs=0.03) and np.abs(turn[:2]).max() < 0.01
    twin.command(0.0, 0.0)
    twin.advance(1.0)
    assert np.abs(twin.velocity).max() < 1e-2 and np.abs(twin.wheel_speeds).max() < 0.01


def test_a_car_drives_nearly_the_circle_that_it_is_steered_to_in_each_gear():
    for speed in (0.8, -0.8):
        ahead, left, turn = moved(Twin(wheels="car"), speed, 0.8)
        assert turn == pytest.approx(0.8, rel=0.05)
        assert math.hypot(ahead, left) == pytest.approx(2.0 * math.sin(0.4), rel=0.05)
        assert ahead * speed > 0.0 and left * speed > 0.0


def test_its_servo_takes_time_and_it_does_not_turn_where_it_stands():
    twin = Twin(wheels="car", pose=(0.3, 0.0, 1.0))
    twin.command(0.0, 0.5)
    twin.advance(0.5)
    assert np.allclose(twin.pose, (0.3, 0.0, 1.0), atol=0.01)
    car = VEHICLES["car"].car
    angles = [twin.data.joint(f"steer_{name}").qpos[0] for name in ("fl", "fr")]
    assert angles == pytest.approx(front_wheels(car, car.steering_angle), abs=0.03)
    assert angles[0] > angles[1] + 0.05, "the inner wheel is steered more"
    twin.command(0.5, 0.0)
    twin.advance(0.1)
    assert twin.data.joint("steer_fl").qpos[0] > 0.1


def test_a_car_that_drives_into_something_feels_it():
    twin = Twin([Circle(1.5, 0.0, 0.2)], wheels="car")
    twin.command(1.0, 0.0)
    twin.advance(0.5)
    assert twin.touched is None
    twin.advance(2.0)
    assert twin.touched is not None and twin.pose[0] < 1.1


def test_a_scenario_says_which_wheels(tmp_path):
    own, text = tmp_path / "own.toml", Scenario.load("twin_a1").to_toml()
    for wheels, name in (('"omni"', "omni"), ('{kind = "car", turning_radius = 0.8}', "car")):
        own.write_text(text.replace("[robot]", f"[robot]\nwheels = {wheels}"))
        assert Twin.of(Scenario.load(own)).vehicle is VEHICLES[name]
    with pytest.raises(ValueError, match=r"one command \(3,\), got \(3,\) and \(2,\)"):
        Twin(wheels="omni").trace(np.zeros(3), np.zeros(2), 0.1, 1)


SIZES = {"wheel_radius": 0.047, "max_wheel_speed": 1.0}


@pytest.mark.parametrize(
    ("geometry", "speeds"),
    [
        (
            CarGeometry(
                wheelbase=0.33, steering_angle=0.4, wheel_radius=0.052, max_wheel_speed=1.0
            ),
            (0.4, 0.3, 0.0),
        ),
        (OmniGeometry(track=0.205, wheelbase=0.106, invert=[2], **SIZES), (0.2, 0.5, 0.2)),
    ],
    ids=["car", "omni"],
)
def test_a_board_drives_it_and_counts_its_wheels(geometry, speeds):
    kind = "car" if isinstance(geometry, CarGeometry) else "omni"
    twin = Twin(wheels=kind)
    body, steer = TwinBody(geometry, twin, 0.0), 0.0
    if kind == "car":
        steer = geometry.steer(*speeds[:2])
        body.steered = geometry.angle(steer) / geometry.steering_angle
    body.command = list(geometry.to_channels(*geometry.wheels(*speeds)))
    body.advance(1.0, lambda _: None)
    before, turns = np.array(body.pose), list(body.turns)
    body.advance(2.0, lambda _: None)
    wheels = geometry.from_channels(*np.subtract(body.turns, turns).tolist())
    told = command_of(geometry.body(wheels, steer), 3)
    ahead, left, turn = seen_from(before, np.array([body.pose]))[0]
    assert turn == pytest.approx(told[2], abs=0.1)
    assert math.hypot(ahead, left) == pytest.approx(math.hypot(*told[:2]), rel=0.1)


def test_a_board_for_other_wheels_is_refused():
    plain = WheelGeometry(track=0.2, **SIZES)
    with pytest.raises(ConfigError, match=r"expected a board for wheels driven, .* left, right"):
        TwinBody(plain, Twin(wheels="car"), 0.0)


@pytest.mark.long
@pytest.mark.parametrize("wheels", ["twin-car", "twin-omni"])
def test_it_is_learned_from_its_log_and_arrives(wheels):
    row = drive_random(wheels, 12)
    assert row.arrived and not row.collided
