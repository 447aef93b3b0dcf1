"""Where a robot makes room for who moves, and how much."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.guidance.moving_obstacles import MovingObstacles, MovingObstacleTable
from kmpc_lite.control.options import MovingObstacleOptions, in_metres

TABLE = MovingObstacleTable(in_metres(MovingObstacleOptions(), 0.15))
SPEED = np.array([0.6, 0.785])
AREA = np.array([[-2.0, -2.0], [2.0, 2.0]])
TIMES = 0.1 * np.arange(21)


def test_a_robot_at_the_edge_of_its_area_makes_no_room_beyond_it() -> None:
    pose = np.array([1.9, 0.0, 0.0])
    coming = np.array([[0.6, 0.1, 0.25, 0.6, 0.0]])
    free = MovingObstacles(coming, 0.15, SPEED, TABLE)
    bounded = MovingObstacles(coming, 0.15, SPEED, TABLE, area=AREA)
    assert free.evasive_arc(pose, -1, TIMES)[1][:, 0].max() > 2.0
    poses = bounded.evasive_arc(pose, -1, TIMES)[1]
    assert poses[:, 0].max() <= 2.001


def test_who_was_seen_to_move_is_given_more_room_the_later_he_comes() -> None:
    pose = np.array([0.0, 0.0, 0.0])
    passing = np.array([[2.0, 0.6, 0.25, -0.6, 0.0]])
    told = MovingObstacles(passing, 0.15, SPEED, TABLE)
    seen = MovingObstacles(passing, 0.15, SPEED, TABLE, spread=np.array([0.3]))
    assert told.spares(pose)
    assert not seen.spares(pose)
