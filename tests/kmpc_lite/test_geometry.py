"""What must hold of angles, rotations, arcs and distances, for scalars and arrays alike."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lite.geometry import (
    exact_arc,
    nearest_turn,
    rotate,
    wrap,
)

ANGLES = st.floats(-1e4, 1e4)


@given(ANGLES)
def test_a_wrapped_angle_lies_in_its_interval_and_points_the_same_way(angle: float) -> None:
    wrapped = wrap(angle)
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-9)


@given(ANGLES)
def test_without_its_nearest_turn_an_angle_is_at_most_half_a_turn(angle: float) -> None:
    turns = nearest_turn(angle)
    assert turns / math.tau == pytest.approx(round(turns / math.tau), abs=1e-9)
    assert abs(angle - turns) <= math.pi + 1e-9


def test_rotation_keeps_lengths_and_turns_counter_clockwise() -> None:
    assert rotate(1.0, 0.0, math.pi / 2) == pytest.approx((0.0, 1.0))
    x, y = rotate(np.array([3.0, 0.0]), np.array([4.0, 2.0]), np.array([0.7, -2.0]))
    np.testing.assert_allclose(np.hypot(x, y), [5.0, 2.0])
    assert (x[0], y[0]) == pytest.approx(rotate(3.0, 4.0, 0.7))


@pytest.mark.parametrize("omega", [0.0, 1e-12, -0.8, 3.0])
@pytest.mark.parametrize("left", [0.0, -0.2])
def test_an_arc_is_where_many_small_steps_end(omega: float, left: float) -> None:
    x, y, theta = 0.3, -0.2, 1.1
    steps = 20_000
    for _ in range(steps):  # midpoint rule
        heading = theta + 0.5 * omega / steps
        x += (0.5 * math.cos(heading) - left * math.sin(heading)) / steps
        y += (0.5 * math.sin(heading) + left * math.cos(heading)) / steps
        theta += omega / steps
    assert exact_arc((0.3, -0.2, 1.1), 0.5, omega, 1.0, left) == pytest.approx((x, y, theta))
