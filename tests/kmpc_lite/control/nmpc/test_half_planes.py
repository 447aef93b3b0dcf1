"""Obstacles and sides of the area as half-planes, in position and in a footprint's heading."""

import numpy as np

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.kernels.clearance import VELOCITY, things_of
from kmpc_lite.control.kernels.half_planes import clearances, nearest_half_planes
from kmpc_lite.control.nmpc.fill_qp import keep_out
from kmpc_lite.control.world.solids import Solids

CART = kl.Footprint.rectangle(0.8, 0.3, ahead=-0.2)
PROBLEM = kl.NavigationProblem(**AREA, horizon=5, footprint=CART, margin=0.02, sensor_range=1.0)
CIRCLES = things_of(np.array([[0.9, 0.4, 0.2, 0.0, 0.0], [-0.5, -0.7, 0.1, 0.1, 0.3]]))
SOLIDS = Solids([kl.Polygon([(0.2, -1.0), (0.8, -1.0), (0.5, -0.4)]), kl.Wall(-1, 1, 1, 1, 0.1)])
STATES = np.random.default_rng(2).uniform((-0.1, -0.1, -3.0), (0.1, 0.1, 3.0), (6, 3))


def of_cart(states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Clearances and normals of the cart."""
    points = CART.places(states[1:]).reshape(-1, 2)
    return clearances(keep_out(PROBLEM, 10), states, CIRCLES, points, *SOLIDS.whole.measure(points))


def test_clearance_is_that_of_the_nearest_circle_of_the_robot() -> None:
    values, normals = of_cart(STATES)
    assert values.shape == (5, 4 * 4 + 5) and normals.shape == (5, 21, 3)
    places, times = CART.places(STATES[1:]), PROBLEM.dt * np.arange(1, 6)
    centres = CIRCLES[:, :2] + times[:, None, None] * CIRCLES[:, VELOCITY]
    away = np.hypot(*(places[:, :, None] - centres[:, None]).transpose(3, 0, 1, 2))
    expected = (away - CIRCLES[:, 2]).min(axis=1) - CART.circle_radius - 0.02
    assert np.allclose(values[:, :8].reshape(5, 4, 2).min(axis=1), expected)
    solids = SOLIDS.whole.least(places.reshape(-1, 2)).reshape(5, 4).min(axis=1)
    assert np.allclose(values[:, 8:16].min(axis=1), solids - CART.circle_radius - 0.02)


def test_normals_are_slopes_by_place_and_heading() -> None:
    step = 1e-6
    values, normals = of_cart(STATES)
    for axis in range(3):
        moved = STATES.copy()
        moved[1:, axis] += step
        slopes = (of_cart(moved)[0] - values) / step
        assert np.allclose(slopes, normals[..., axis], atol=1e-5)


def test_half_planes_hold_the_clearance_where_they_were_made() -> None:
    values, all_normals = of_cart(STATES)
    normals, offsets = nearest_half_planes(STATES, values, all_normals, 6)
    assert normals.shape == (5, 6, 3)
    left = (normals * STATES[1:, None]).sum(axis=-1) - offsets
    assert np.allclose(np.sort(left), np.sort(values, axis=1)[:, :6])


SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def test_solids_stand_between_circles_and_sides() -> None:
    problem = kl.NavigationProblem(**AREA, horizon=3)
    solids = Solids([kl.Polygon(SQUARE), kl.Wall(-1, -1, -1, 1, 0.2)]).whole
    states = np.array([[-0.5, 0.5, 0.0], [-0.4, 0.5, 0.0], [-0.3, 0.5, 0.0], [-0.2, 0.5, 0.0]])
    circles = things_of(np.array([[-0.3, 1.5, 0.1, 0.0, 0.0]]))
    points = states[1:, :2]
    found = solids.measure(points)
    gaps, normals = clearances(keep_out(problem, 8), states, circles, points, *found)
    assert gaps.shape == (3, 7)
    np.testing.assert_allclose(gaps[:, 1], [0.25, 0.15, 0.05])
    np.testing.assert_allclose(gaps[:, 2], [0.35, 0.45, 0.55])
    np.testing.assert_allclose(normals[:, 1], [[-1, 0]] * 3, atol=1e-12)
