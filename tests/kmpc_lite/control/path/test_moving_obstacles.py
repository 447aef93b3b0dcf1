"""Where a robot makes room for what moves, and how much."""

import numpy as np
import pytest

from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.options import MovingObstacleOptions, lengths_from_radii
from kmpc_lite.control.path.moving_obstacles import MovingObstacles, MovingObstacleTable

TABLE = MovingObstacleTable(lengths_from_radii(MovingObstacleOptions(), 0.15))
SPEED = np.array([0.6, 0.785])
AREA = np.array([[-2.0, -2.0], [2.0, 2.0]])
TIMES = 0.1 * np.arange(21)


def test_a_robot_at_the_edge_of_its_area_makes_no_room_beyond_it() -> None:
    pose = np.array([1.9, 0.0, 0.0])
    coming = np.array([[0.6, 0.1, 0.25, 0.6, 0.0]])
    free = MovingObstacles(things_of(coming), 0.15, SPEED, TABLE)
    bounded = MovingObstacles(things_of(coming), 0.15, SPEED, TABLE, area=AREA)
    assert free.evasive_arc(pose, -1, TIMES)[1][:, 0].max() > 2.0
    poses = bounded.evasive_arc(pose, -1, TIMES)[1]
    assert poses[:, 0].max() <= 2.001


def test_an_obstacle_that_does_not_pass_is_kept_away_from_by_how_far_it_comes() -> None:
    pose = np.array([-1.0, 0.0, 0.0])
    creeping = np.array([[0.0, 0.0, 0.25, 0.0, 0.05], [0.0, 1.0, 0.2, 0.0, 0.0]])
    found = MovingObstacles(creeping, 0.15, SPEED, TABLE)
    (before, _), (after, still) = found.where_met(pose, 4.0), found.where_met(pose, 4.1)
    arrival = 0.6 / 0.6
    assert before == pytest.approx([0.0, 0.05 * arrival, 0.25 + 0.06, 0.0, 0.05], abs=2e-3)
    assert after[2] == pytest.approx(0.25 + 0.12 + 0.05 * (4.0 - arrival), abs=2e-3)
    assert still.tolist() == creeping[1].tolist()
    assert not found.stays(4.0) and found.stays(4.1)
