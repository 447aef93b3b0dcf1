"""Circles at the border, and distances and normals inside."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lite import Circle, ProblemError
from kmpc_lite.control.world.circles import circle_distances, circles_to_array

NAN, INF = float("nan"), float("inf")
near = st.floats(-3.0, 3.0)


@pytest.mark.parametrize(
    "values",
    [(NAN, 0, 1), (0, INF, 1), (0, 0, NAN), (0, 0, INF), (0, 0, 1, NAN, 0), (0, 0, 1, 0, -INF)],
)
def test_circles_must_be_finite(values: tuple[float, ...]) -> None:
    with pytest.raises(ProblemError, match="finite"):
        Circle(*values)


def test_a_negative_radius_is_refused_with_the_place() -> None:
    with pytest.raises(ProblemError, match=r"\(1, 2\).*-0\.5"):
        Circle(1.0, 2.0, -0.5)
    assert Circle(1.0, 2.0, 0.0).radius == 0.0


def test_circles_are_plain_floats_and_equal_by_value() -> None:
    assert Circle(1, 2, 3) == Circle(1.0, 2.0, 3.0, 0.0, 0.0)
    assert all(type(v) is float for v in Circle(np.float32(1), 2, 3))
    assert hash(Circle(1, 2, 3)) == hash(Circle(1.0, 2.0, 3.0))


@pytest.mark.parametrize(
    "given_as",
    [
        [Circle(1, 2, 3, 4, 5)],
        [[1, 2, 3, 4, 5]],
        np.array([[1, 2, 3, 4, 5]]),
        (Circle(1, 2, 3, 4, 5),),
    ],
)
def test_rows_of_any_kind_become_one_array(given_as: Any) -> None:
    array = circles_to_array(given_as)
    np.testing.assert_array_equal(array, [[1, 2, 3, 4, 5]])
    assert array.dtype == float


def test_rows_without_velocity_stand_still() -> None:
    np.testing.assert_array_equal(
        circles_to_array([[1, 2, 3], [4, 5, 6]]), [[1, 2, 3, 0, 0], [4, 5, 6, 0, 0]]
    )
    for nothing in ((), [], np.empty((0, 3)), np.empty((0, 5))):
        assert circles_to_array(nothing).shape == (0, 5)


@pytest.mark.parametrize(
    "wrong", [np.zeros(3), np.zeros((2, 4)), np.zeros((1, 2, 5)), np.zeros((0, 4)), 3.0, [[1, 2]]]
)
def test_other_shapes_are_refused_with_their_shape(wrong: Any) -> None:
    with pytest.raises(ValueError, match="shape"):
        circles_to_array(wrong)


@given(
    circles=st.lists(
        st.tuples(near, near, st.floats(0.0, 1.0), near, near), min_size=1, max_size=4
    ),
    positions=st.lists(st.tuples(near, near, st.floats(0.0, 3.0)), min_size=1, max_size=4),
)
def test_distances_and_normals_are_those_of_each_pair(
    circles: list[Any], positions: list[Any]
) -> None:
    rows, points = np.array(circles), np.array(positions)
    kept = rows.copy(), points.copy()
    distances, normals = circle_distances(rows, points[:, :2], points[:, 2])
    assert distances.shape == (len(points), len(rows)) and normals.shape == (
        len(points),
        len(rows),
        2,
    )
    for k, (x, y, t) in enumerate(positions):
        for i, (cx, cy, radius, vx, vy) in enumerate(circles):
            away = np.array([x - cx - t * vx, y - cy - t * vy])
            length = np.hypot(*away)
            assert distances[k, i] == pytest.approx(length - radius, abs=1e-8)
            assert np.hypot(*normals[k, i]) == pytest.approx(1.0)
            if length > 1e-6:
                np.testing.assert_allclose(normals[k, i], away / length, atol=1e-6)
    np.testing.assert_array_equal(rows, kept[0])
    np.testing.assert_array_equal(points, kept[1])


def test_at_a_centre_the_normal_is_some_unit_vector() -> None:
    distances, normals = circle_distances(
        np.array([[1.0, 2.0, 0.3, 0.0, 0.0]]), np.array([[1.0, 2.0]]), np.zeros(1)
    )
    assert distances[0, 0] == pytest.approx(-0.3)
    assert np.hypot(*normals[0, 0]) == pytest.approx(1.0)


def test_a_moving_circle_is_where_it_will_be() -> None:
    distances, _ = circle_distances(
        np.array([[0.0, 0.0, 0.5, 1.0, 0.0]]),
        np.array([[2.0, 0.0], [2.0, 0.0]]),
        np.array([0.0, 2.0]),
    )
    np.testing.assert_allclose(distances[:, 0], [1.5, -0.5], atol=1e-8)
