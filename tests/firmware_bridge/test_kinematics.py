"""Wheel speeds keep the curvature, counters wrap, arcs are exact, options say what is wrong."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.kinematics import WheelGeometry
from firmware_bridge.messages import ConfigError
from firmware_bridge.odometry import WheelOdometry, wrapped
from firmware_bridge.options import from_table

ROSBOT = WheelGeometry(wheel_radius=0.0425, track=0.27, max_wheel_speed=0.9)
finite = st.floats(allow_nan=False, allow_infinity=False)
speeds = st.floats(-3.0, 3.0)
geometries = st.builds(
    WheelGeometry,
    wheel_radius=st.floats(0.01, 0.05),
    track=st.floats(0.05, 3.0),
    max_wheel_speed=st.floats(0.1, 5.0),
    gear_ratio=st.floats(0.1, 100.0),
    invert_left=st.booleans(),
    invert_right=st.booleans(),
    swap=st.booleans(),
)


@given(geometries, speeds, speeds)
def test_wheels_are_within_the_limit_at_the_same_curvature(geometry, v, omega):
    left, right = geometry.wheels(v, omega)
    assert max(abs(left), abs(right)) * geometry.wheel_radius <= geometry.max_wheel_speed * (
        1 + 1e-12
    )
    v_out, omega_out, _ = geometry.body((left, right))
    assert v_out * omega == pytest.approx(omega_out * v, abs=1e-9)
    assert v_out * v >= 0.0 and omega_out * omega >= -1e-12
    if (
        max(abs(v - omega * geometry.track / 2), abs(v + omega * geometry.track / 2))
        <= geometry.max_wheel_speed
    ):
        assert (v_out, omega_out) == pytest.approx((v, omega), abs=1e-9)


@pytest.mark.parametrize(
    "command", [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)]
)
def test_non_finite_commands_are_refused(command):
    with pytest.raises(ValueError, match="expected finite speeds"):
        ROSBOT.wheels(*command)


def test_signs_and_order_of_the_channels():
    robot = {"wheel_radius": 0.1, "track": 0.5, "max_wheel_speed": 2.0, "gear_ratio": 3.0}
    plain = WheelGeometry(**robot)
    assert plain.to_channels(math.tau, 2 * math.tau) == pytest.approx((3.0, 6.0))
    odd = WheelGeometry(
        wheel_radius=0.1,
        track=0.5,
        max_wheel_speed=2.0,
        gear_ratio=3.0,
        invert_left=True,
        swap=True,
    )
    assert odd.to_channels(math.tau, 2 * math.tau) == pytest.approx((6.0, -3.0))


@pytest.mark.parametrize("start", [0, 2**31 - 5, -(2**31) + 5])
def test_odometry_follows_exact_arcs_across_the_wrap(start):
    counts = 10_000.0
    odometry = WheelOdometry(ROSBOT, counts, wraps=True)
    v, omega, dt, total = 0.4, 0.7, 0.02, [float(start), float(start)]
    for k in range(501):
        assert odometry.update(tuple(int(wrapped(round(c))) for c in total), k * dt)
        turns = ROSBOT.to_channels(*ROSBOT.wheels(v, omega))
        total = [c + turn * dt * counts for c, turn in zip(total, turns, strict=True)]
    t = 500 * dt
    x, y = v / omega * math.sin(omega * t), v / omega * (1 - math.cos(omega * t))
    assert (odometry.x, odometry.y) == pytest.approx((x, y), abs=2e-3)
    assert math.remainder(odometry.theta - omega * t, math.tau) == pytest.approx(0.0, abs=2e-3)
    assert -math.pi <= odometry.theta <= math.pi


def test_impossible_jumps_do_not_move_the_robot():
    odometry = WheelOdometry(ROSBOT, 1000.0, wraps=True)
    assert odometry.update((50_000, 50_000), 0.0) and odometry.update((50_010, 50_010), 0.02)
    x = odometry.x
    for k in range(3):
        assert not odometry.update((10 * k, 10 * k), 0.04 + 0.02 * k) and odometry.x == x
    assert odometry.update((30, 30), 0.1) and odometry.x == pytest.approx(4 * x)
    assert not odometry.update((math.nan, 0), 0.12)


def test_one_damaged_reply_costs_no_motion():
    clean, damaged = (
        WheelOdometry(ROSBOT, 1000.0, wraps=True),
        WheelOdometry(ROSBOT, 1000.0, wraps=True),
    )
    for k in range(50):
        counts = (10 * k, 12 * k)
        assert clean.update(counts, 0.02 * k)
        bad = k in (10, 20, 21, 30)
        assert damaged.update((70_000 + 999 * k * k, 5) if bad else counts, 0.02 * k) != bad
    assert (damaged.x, damaged.y, damaged.theta) == pytest.approx(
        (clean.x, clean.y, clean.theta), abs=1e-4
    )


@pytest.mark.parametrize("gap", [0.06, 0.15, 0.4, 1.0])
@pytest.mark.parametrize("v", [0.3, -0.3])
def test_counters_that_come_back_to_zero_after_a_gap_are_no_way_back(gap, v):
    """A reset of the board, seen after a slow poll, was taken as motion backward."""
    per_metre = 1000.0 / (math.tau * 0.0425)
    odometry = WheelOdometry(ROSBOT, 1000.0, wraps=True)
    speeds = ROSBOT.to_channels(*ROSBOT.wheels(v, 0.0))
    for k in range(51):
        assert odometry.update((0.02 * k * v * per_metre,) * 2, 0.02 * k, speeds)
    x = odometry.x
    assert x == pytest.approx(v)
    for k in range(3):
        assert odometry.beginnings == 0
        rolled = 0.01 * v * per_metre
        assert not odometry.update((rolled, rolled), 1.0 + gap + 0.02 * k, (0.0, 0.0))
        assert odometry.x == x or k == 2
    assert odometry.beginnings == 1
    assert odometry.x - x == pytest.approx(v * min(gap, 0.5) / 2)  # by its speeds before and after


@pytest.mark.parametrize("gap", [0.02, 0.06, 0.15, 0.4])
@pytest.mark.parametrize("start", [-0.1, 0.1, 0.2])
def test_a_robot_that_drives_across_zero_and_back_is_believed(gap, start):
    per_metre = 1000.0 / (math.tau * 0.0425)
    odometry = WheelOdometry(ROSBOT, 1000.0, wraps=True)
    for k in range(200):
        t = gap * k
        v, way = 0.3 * math.cos(t), 0.3 * math.sin(t)
        speeds = ROSBOT.to_channels(*ROSBOT.wheels(v, 0.0))
        assert odometry.update(((start + way) * per_metre,) * 2, t, speeds)
    assert odometry.x == pytest.approx(way, abs=1e-9) and odometry.beginnings == 0


GOOD = {"wheel_radius": 0.05, "track": 0.3, "max_wheel_speed": 1}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"wheel_radius": -0.05}, "geometry.wheel_radius: expected 0.001 to 10 m, got -0.05"),
        (
            {"wheel_radius": 5},
            "geometry.wheel_radius: expected at most the track of 0.3 m, got 5 m",
        ),
        ({"track": True}, "geometry.track: expected float, got True"),
        (
            {"wheels": 4},
            "geometry.wheels: unknown key; [geometry] takes wheel_radius, max_wheel_speed",
        ),
        ({"track": None}, "geometry.track: missing"),
    ],
)
def test_bad_geometry_names_the_key(change, message):
    table = {key: value for key, value in {**GOOD, **change}.items() if value is not None}
    with pytest.raises(ConfigError) as caught:
        from_table(WheelGeometry, table, "geometry")
    assert str(caught.value).startswith(message)
