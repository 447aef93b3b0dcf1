"""NED and ENU."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.frames import enu_to_ned, forward_speed, ned_to_enu

metres = st.floats(-1e5, 1e5)
angles = st.floats(-50.0, 50.0)


@pytest.mark.parametrize(
    ("yaw", "theta"),
    [
        (0.0, math.pi / 2),
        (math.pi / 2, 0.0),
        (math.pi, -math.pi / 2),
        (-math.pi / 2, math.pi),
        (math.pi / 4, math.pi / 4),
    ],
)
def test_headings_of_the_compass(yaw: float, theta: float) -> None:
    assert ned_to_enu(2.0, 1.0, yaw) == pytest.approx((1.0, 2.0, theta))
    assert enu_to_ned(1.0, 2.0, theta) == pytest.approx((2.0, 1.0, yaw))


@given(metres, metres, angles)
def test_round_trip(x: float, y: float, theta: float) -> None:
    back = ned_to_enu(*enu_to_ned(x, y, theta))
    assert back[:2] == (x, y)
    assert math.isclose(math.cos(back[2] - theta), 1.0, abs_tol=1e-12)
    assert -math.pi < back[2] <= math.pi


@given(angles, st.floats(-5.0, 5.0))
def test_the_nose_points_the_same_way_in_both(theta: float, speed: float) -> None:
    """Driving forward for a second moves both descriptions to the same place."""
    x, y = speed * math.cos(theta), speed * math.sin(theta)
    north, east, yaw = enu_to_ned(x, y, theta)
    assert (north, east) == pytest.approx((speed * math.cos(yaw), speed * math.sin(yaw)), abs=1e-9)
    assert forward_speed(north, east, yaw) == pytest.approx(speed, abs=1e-9)
