"""The truth about touching: outline to outline."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from kmpc_lite.control import Footprint, OccupancyGrid, Polygon, Wall
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

CART = Footprint.rectangle(0.8, 0.3)
NO_CIRCLES = np.zeros((1, 0, 3))


def edge_points(corners: Array) -> Array:
    shares = np.linspace(0.0, 1.0, 300, endpoint=False)[:, None, None]
    return (corners + shares * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)


def test_distance_is_that_of_the_outlines() -> None:
    random, apart = np.random.default_rng(3), 0
    for _ in range(40):
        pose = np.array([*random.uniform(-1.2, 1.2, 2), random.uniform(-4.0, 4.0)])
        angles = np.sort(random.uniform(0.0, 2.0 * np.pi, 3) + (0.0, 0.2, 0.4))
        corners = 0.5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        other = np.array(Polygon(corners).vertices)
        gap = float(footprint_gaps(CART, pose[None], NO_CIRCLES, [Polygon(other)])[0])
        sampled = cKDTree(edge_points(CART.at(pose))).query(edge_points(other))[0].min()
        apart += gap > 0.0
        assert abs(gap - sampled) < 3e-3 if gap > 0.0 else sampled < 3e-3 or gap < -0.05
    assert 10 < apart < 40


@pytest.mark.parametrize(
    ("pose", "gap"),
    [
        ((0.0, 0.2, 0.0), 0.2 - 0.15 - 0.01),
        ((0.0, 0.5, np.pi / 2), 0.5 - 0.4 - 0.01),
        ((0.0, 0.0, np.pi / 2), -0.41),
        ((1.9, 0.0, 0.0), 0.5 - 0.01),
    ],
)
def test_wall(pose: tuple[float, float, float], gap: float) -> None:
    # it crosses the robot from side to side in the third: no corner of either lies in the other
    found = footprint_gaps(CART, np.array([pose]), NO_CIRCLES, [Wall(-1, 0, 1, 0, 0.02)])
    assert found == pytest.approx(gap)


def test_grid_and_circles() -> None:
    grid, pose = (
        OccupancyGrid([[100, 0], [0, 0]], 0.5, (1.0, 1.0, 0.0)),
        np.array([[0.0, 1.2, 0.0]]),
    )
    assert footprint_gaps(CART, pose, NO_CIRCLES, [grid]) == pytest.approx(0.6)
    circles = np.array([[[0.0, 0.5, 0.1], [3.0, 3.0, 0.1]]])
    assert footprint_gaps(CART, pose, circles, []) == pytest.approx(0.7 - 0.15 - 0.1)
    assert footprint_gaps(CART, pose, NO_CIRCLES, []) == np.inf
    empty = OccupancyGrid([[0, 0]], 0.5)
    assert footprint_gaps(CART, pose, NO_CIRCLES, [empty]) == np.inf


def test_moving_circle_is_where_it_is_then() -> None:
    table = {
        "map": {"bounds": [-2, -2, 2, 2], "circles": [[0.0, 1.0, 0.1, 0.0, -0.5]]},
        "robot": {
            "footprint": {"length": 0.8, "width": 0.3},
            "start": [0.0, 0.0, 0.0],
            "goal": [1.0, 0.0, 0.0],
        },
    }
    scenario = Scenario.from_table(table, "crossing", "crossing")
    gaps = obstacle_gaps(scenario, np.zeros((2, 3)), np.array([0.0, 1.0]))
    assert gaps == pytest.approx([0.75, 0.25])
