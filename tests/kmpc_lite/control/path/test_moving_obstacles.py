"""Where a robot makes room for who moves, and how much."""

from __future__ import annotations

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


def test_who_was_seen_to_move_is_given_more_room_the_later_he_comes() -> None:
    pose = np.array([0.0, 0.0, 0.0])
    passing = np.array([[2.0, 0.6, 0.25, -0.6, 0.0]])
    told = MovingObstacles(things_of(passing), 0.15, SPEED, TABLE)
    seen = MovingObstacles(things_of(passing, 0.3, 0.15), 0.15, SPEED, TABLE)
    assert told.spares(pose)
    assert not seen.spares(pose)


@pytest.mark.parametrize(("beyond", "last"), [(0.0009, False), (0.0011, True)])
def test_an_evasive_arc_may_lead_out_of_the_area_by_a_millimetre(beyond: float, last: bool) -> None:
    coming = np.array([[-1.0, 0.0, 0.25, 0.1, 0.0]])
    # the arc of one second at half the speed, straight ahead, ends at 0.3 m
    number = TABLE.arcs.tolist().index([0.5, 0.0, 1.0])
    area = np.array([[-2.0, -2.0], [0.3 - beyond, 2.0]])
    found = MovingObstacles(things_of(coming), 0.15, SPEED, TABLE, area=area)
    clearance = found._clearance_on_arcs(np.zeros(3), TABLE.times)
    assert bool(clearance[number] < clearance[0]) is last


@pytest.mark.parametrize(("promised", "kept"), [(0.0299, True), (0.0301, False)])
def test_an_arc_is_left_for_one_with_three_centimetres_more_clearance(
    promised: float, kept: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    clearance = np.full(len(TABLE.arcs), -1.0)
    clearance[[2, 5]] = 0.0, promised
    monkeypatch.setattr(MovingObstacles, "_clearance_on_arcs", lambda *rest: clearance.copy())
    found = MovingObstacles(np.array([[1.0, 0.0, 0.2, -0.5, 0.0]]), 0.15, SPEED, TABLE)
    number, _ = found.evasive_arc(np.zeros(3), 2, TIMES)
    assert number == (2 if kept else 5)


def test_who_does_not_pass_is_kept_away_from_by_how_far_he_comes() -> None:
    pose = np.array([-1.0, 0.0, 0.0])
    creeping = np.array([[0.0, 0.0, 0.25, 0.0, 0.05], [0.0, 1.0, 0.2, 0.0, 0.0]])
    found = MovingObstacles(creeping, 0.15, SPEED, TABLE)
    (before, _), (after, still) = found.where_met(pose, 4.0), found.where_met(pose, 4.1)
    arrival = 0.6 / 0.6
    assert before == pytest.approx([0.0, 0.05 * arrival, 0.25 + 0.06, 0.0, 0.05], abs=2e-3)
    assert after[2] == pytest.approx(0.25 + 0.12 + 0.05 * (4.0 - arrival), abs=2e-3)
    assert still.tolist() == creeping[1].tolist()
    assert not found.stays(4.0) and found.stays(4.1)
