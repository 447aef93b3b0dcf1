"""Where things are, and when, against a brute-force look at dense points of their edges."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from kmpc_lite.control.kernels import clearance as kernel
from kmpc_lite.types import Array

NEAR, SIZE = st.floats(-3.0, 3.0), st.floats(0.0, 1.0)
THINGS = st.lists(
    st.tuples(
        NEAR, NEAR, st.floats(0.0, 1.0), NEAR, NEAR, st.floats(0.0, 1.0), st.floats(0.0, 0.5)
    ),
    min_size=1,
    max_size=5,
).map(np.array)
POINTS = st.lists(st.tuples(NEAR, NEAR, st.floats(0.0, 3.0)), min_size=1, max_size=5).map(np.array)
ANGLES = np.linspace(-np.pi, np.pi, 20_000)


def edge(thing: Array, time: float) -> Array:
    """Dense points (K, 2) of a thing's edge at a time."""
    x, y, radius, vx, vy, rate, most = thing
    size = radius + min(rate * time, most)
    centre = np.array([x + vx * time, y + vy * time])
    points: Array = centre + size * np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)
    return points


def is_inside(thing: Array, point: Array, time: float) -> bool:
    x, y, radius, vx, vy, rate, most = thing
    away = np.hypot(point[0] - x - vx * time, point[1] - y - vy * time)
    return bool(away < radius + min(rate * time, most))


@given(things=THINGS, points=POINTS)
def test_distances_are_those_to_the_edges(things: Array, points: Array) -> None:
    kept = things.copy(), points.copy()
    found, directions = kernel.distances_and_directions(things, points[:, :2], points[:, 2])
    plain = kernel.distances(things, points[:, :2], points[:, 2])
    np.testing.assert_allclose(found, plain, atol=2e-9)
    for (*point, time), row, ways in zip(points, found, directions, strict=True):
        for thing, distance, way in zip(things, row, ways, strict=True):
            assert np.hypot(*way) == pytest.approx(1.0)
            dense = np.hypot(*(edge(thing, time) - point).T).min()
            assert abs(distance) == pytest.approx(dense, abs=1e-3)
            if dense > 1e-3:
                assert bool(distance < 0.0) is is_inside(thing, np.array(point), time)
                # a step along the direction leads away by as much, but for a centre
                step = 1e-4 * way
                farther = kernel.distances(thing[None], (point + step)[None], np.array([time]))
                assert farther[0, 0] - distance == pytest.approx(1e-4, rel=1e-3, abs=2e-9)
    np.testing.assert_array_equal(things, kept[0])
    np.testing.assert_array_equal(points, kept[1])


@given(things=THINGS, points=POINTS, ahead=st.floats(0.0, 2.0))
def test_what_is_there_later_is_there_at_a_later_time(
    things: Array, points: Array, ahead: float
) -> None:
    after = kernel.distances(kernel.later(things, ahead), points[:, :2], points[:, 2])
    now = kernel.distances(things, points[:, :2], points[:, 2] + ahead)
    np.testing.assert_allclose(after, now, atol=1e-9)
