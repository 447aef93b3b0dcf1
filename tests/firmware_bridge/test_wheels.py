"""Cars and omnis: robot files, kinematics, odometry, gate, rows of a recording."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.integration.course import base_problem, load_model
from firmware_bridge.kinematics import CarGeometry, OmniGeometry, curvature_of
from firmware_bridge.messages import ConfigError, State
from firmware_bridge.odometry import Steering, WheelOdometry
from firmware_bridge.recording.recorder import HEADERS, RowSampler, Tick
from firmware_bridge.robot_file import load_robot
from firmware_bridge.wheels import Wheels, read_wheels
from kmpc_lite import Car, Omni

CAR = CarGeometry(
    wheel_radius=0.05, max_wheel_speed=1.5, wheelbase=0.3, steering_angle=0.5, steering_rate=4.0
)
OMNIS = (
    OmniGeometry(wheel_radius=0.05, max_wheel_speed=1.0, track=0.3, wheelbase=0.2, invert=(2, 4)),
    OmniGeometry(wheel_radius=0.04, max_wheel_speed=1.0, arm=0.15),
    OmniGeometry(wheel_radius=0.04, max_wheel_speed=1.0, arm=0.2, count=4, gear_ratio=9.0),
)
speeds = st.floats(-3.0, 3.0)


@given(st.sampled_from(OMNIS), speeds, speeds, speeds)
def test_an_omnis_wheels_keep_the_direction_within_their_limit(geometry, v, omega, vy):
    wheels = geometry.wheels(v, omega, vy)
    assert max(map(abs, wheels)) * geometry.wheel_radius <= 1.0 + 1e-12
    body = np.array(geometry.body(wheels))
    share = body @ (v, omega, vy) / max(1e-30, np.dot((v, omega, vy), (v, omega, vy)))
    assert share <= 1.0 + 1e-9
    np.testing.assert_allclose(body, share * np.array((v, omega, vy)), atol=1e-9)
    assert geometry.from_channels(*geometry.to_channels(*wheels)) == pytest.approx(wheels)


def test_the_third_speed_drives_to_the_left():
    for geometry in OMNIS:
        odometry = WheelOdometry(geometry, 100.0, wraps=True)
        for k in range(60):
            turns = (0.02 * k * w for w in geometry.to_channels(*geometry.wheels(0.0, 0.0, 0.3)))
            assert odometry.update(tuple(round(100.0 * t) for t in turns), 0.02 * k)
        assert odometry.y == pytest.approx(0.3 * 1.18, abs=0.01)
        assert (odometry.x, odometry.theta) == pytest.approx((0.0, 0.0), abs=0.01)


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), st.floats(-2.0, 2.0))
def test_any_command_steers_a_car_within_its_lock(v, omega, before):
    curvature = curvature_of(v, omega, 2.0, before)
    assert abs(curvature) <= 2.0
    if v == omega == 0.0:
        assert curvature == before
    elif abs(omega) < 2.0 * abs(v):
        assert curvature * v == pytest.approx(omega)
    else:
        assert curvature == math.copysign(2.0, omega * math.copysign(1.0, v))


def test_a_cars_wheels_are_steered_where_it_stands_and_then_take_it_round():
    steering, odometry = Steering(CAR), WheelOdometry(CAR, 1000.0, wraps=True)
    steering.command(0.0, 0.1, 5.0)
    assert 0.0 < steering.at(5.1) < steering.at(5.2) < steering.at(6.0) == CAR.sharpest
    assert steering.share == pytest.approx(1.0)
    steering.command(0.0, 0.0, 6.0)
    assert steering.at(7.0) == CAR.sharpest, "to stand leaves the wheels as they are"
    for k in range(101):  # a quarter of the circle
        way = 0.25 * math.tau / CAR.sharpest * k / 100.0
        counts = round(1000.0 * way / CAR.wheel_radius / math.tau)
        assert odometry.update((counts,), 7.0 + 0.05 * k, None, steering.at(7.0 + 0.05 * k))
    radius = 1.0 / CAR.sharpest
    here = odometry.x, odometry.y, odometry.theta
    assert here == pytest.approx((radius, radius, math.pi / 2), abs=0.01)


@pytest.mark.parametrize("kind", ["car", "omni"])
def test_a_row_holds_what_the_wheels_were_commanded(kind):
    wheels = Wheels(kind, turning_radius=0.5 if kind == "car" else None)
    sampler, rows = RowSampler(0.1, wheels=wheels), []
    for k in range(200):
        t = 0.02 * k
        # a car's wheels are steered, then it drives and stands again
        speeds = (0.0, 0.3, 0.0) if k < 50 else (0.4, -0.4, 0.1) if k < 100 else (0.0, 0.0, 0.0)
        rows += sampler.take(Tick(t, State(0.0, 0.0, 0.0, 0.0, 0.0, t), speeds, True, k == 0))
    if kind == "omni":
        assert HEADERS[kind] == b"t,x,y,theta,v,vy,omega\n"
        assert rows[12][4:] == pytest.approx((0.4, 0.1, -0.4))
    else:
        assert HEADERS[kind] == b"t,x,y,theta,v,curvature\n"
        assert [rows[k][4:] for k in (2, 12, 30)] == [
            pytest.approx(row) for row in ((0.0, 2.0), (0.4, -1.0), (0.0, -1.0))
        ]


@pytest.mark.parametrize(
    ("wheels", "words"),
    [
        ("bus", "robot.wheels.kind: expected differential, car, omni, got 'bus'"),
        ({"kind": "car", "turning_radius": -1.0}, "robot.wheels.turning_radius: expected 0.001 to"),
        ({"kind": "omni", "turning_radius": 1.0}, "turning_radius: only a car has one"),
        (
            {"kind": "car", "turning_radius": 0.1, "wheelbase": 0.3, "steering_angle": 0.4},
            "turning_radius: 0.1 m is less than the wheels can be steered to, 0.71 m",
        ),
        (3, r"\[robot.wheels\]: expected a table"),
    ],
)
def test_wheels_that_make_no_sense_are_refused_in_one_line(wheels, words):
    with pytest.raises(ConfigError, match=words) as error:
        read_wheels(wheels, {})
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("robot", "words"),
    [
        ({"wheels": "omni"}, "robot.wheels: omni: the driver for MAVLink drives differential, car"),
        ({}, "limits.v_sideways: only an omni drives sideways"),
    ],
)
def test_wheels_that_a_link_cannot_drive_are_refused(robot, words):
    told = {"url": "tcp:127.0.0.1:1", "driver": "mavlink"}
    with pytest.raises(ConfigError, match=words):
        load_robot(None, {"link": told, "robot": robot, "limits": {"v_sideways": 0.1}})


def test_a_robot_files_car_is_the_controllers():
    car = {"kind": "car", "wheelbase": 0.3, "steering_angle": 0.5, "steering_rate": 3.0}
    told = {"url": "tcp:127.0.0.1:1", "driver": "mavlink"}
    robot = load_robot(None, {"link": told, "robot": {"wheels": car}})
    assert base_problem(robot, 0.1).wheels == Car(0.3 / math.tan(0.5), 3.0)
    assert robot.vehicle["wheels"] == "car"
    omni = load_robot(None, {"link": {**told, "driver": "ros2"}, "robot": {"wheels": "omni"}})
    problem = base_problem(omni, 0.1)
    assert problem.wheels == Omni() and problem.u_max.tolist() == [0.3, 0.3, 0.8]
    assert load_model(omni)[1].inputs == 3
