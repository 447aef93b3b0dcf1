"""Maps of messages: their updates and frames, and what is no map."""

import math
from typing import Any

import numpy as np
import pytest

pytest.importorskip("rosbags", reason="the extra ros2 (rosbags) is not installed")
from ros_inputs import EPOCH, MAKE, NAN, TYPES, inputs, spoil, transform

from firmware_bridge.ros2.message_types import GRID_UPDATE
from firmware_bridge.ros2.obstacles import GridOptions
from kmpc_lab.emulator.ros2.world import CellMap


def map_of(rows: Any, resolution: float = 0.5, frame: str = "map") -> Any:
    cells = CellMap(np.array(rows, dtype=np.int8), resolution, (-1.0, -1.0))
    return MAKE.map(cells, EPOCH, frame)


def test_a_map_its_update_and_its_frame() -> None:
    here = inputs("scan=")
    (grid,) = here.grids
    assert here.problems(10.0) == ("no map on /map yet",)
    grid.take(map_of([[0, 0, 0], [0, 100, 0]]), 10.0)
    here.build(10.0)
    assert here.problems(10.0) == ()
    (found,) = here.obstacles(10.0, 10.0)
    assert found.rectangles.tolist() == [[0.5, 0.5, 1.0, 1.0]] and found.origin == (-1.0, -1.0, 0.0)
    update = TYPES.make(
        GRID_UPDATE,
        header=MAKE.header(EPOCH, "map"),
        x=0,
        y=0,
        width=2,
        height=1,
        data=np.array([100, 100], dtype=np.int8),
    )
    grid.update(update, 11.0)
    here.build(11.0)
    assert here.obstacles(11.0, 11.0)[0].occupied.tolist() == [
        [True, True, False],
        [False, True, False],
    ]
    # a costmap that rolls with the robot lies in the frame of odometry
    grid.take(map_of([[0, 100]], frame="odom"), 12.0)
    here.build(12.0)
    assert "no fresh transform map -> odom" in here.problems(12.0)[0]
    transform(here, 12.0, "map", "odom", (5.0, 0.0, 0.0))
    here.build(12.0)
    assert here.obstacles(12.0, 12.0)[0].origin == pytest.approx((4.0, -1.0, 0.0))


def test_a_costmap_that_falls_silent_stops_the_robot() -> None:
    here = inputs("scan=", grid=GridOptions(threshold=100.0, longest=1.0))
    here.grids[0].take(map_of([[0, 99, 100]]), 10.0)
    here.build(10.0)
    assert here.obstacles(10.0, 10.0)[0].occupied.tolist() == [[False, False, True]]
    assert here.problems(10.9) == ()
    assert here.problems(11.5) == ("no map on /map for 1.5 s",)


NOISE = np.random.default_rng(0).integers(0, 2, 360_000).astype(np.int8) * 100
TURNED = "info.origin.orientation"
WRONG: dict[str, dict[str, Any]] = {
    "too few cells": {"info.height": 3},
    "four billion columns": {"info.width": 2**32 - 1},
    "no cells": {"info.width": 0, "info.height": 0, "data": np.zeros(0, dtype=np.int8)},
    "value": {"data": np.array([0, 0, 0, 101], dtype=np.int8)},
    "resolution": {"info.resolution": NAN},
    "origin": {"info.origin.position.x": math.inf},
    "orientation": {f"{TURNED}.w": 0.0},
    "tilted": {f"{TURNED}.x": 1.0, f"{TURNED}.w": 0.0},
    "noise": {"info.width": 600, "info.height": 600, "info.resolution": 0.05, "data": NOISE},
}


@pytest.mark.parametrize("what", WRONG)
def test_a_map_that_is_none_is_reported_in_one_line_and_not_driven_by(what: str) -> None:
    here = inputs("scan=")
    here.grids[0].take(spoil(map_of([[0, 0], [0, 100]]), WRONG[what]), 10.0)
    here.build(10.0)
    (text,) = here.problems(10.0)
    assert text.startswith("/map: ") and "\n" not in text and len(text) < 250


@pytest.mark.parametrize(("x", "width"), [(-1, 2), (2, 2), (0, 2**31), (0, 1)])
def test_an_update_outside_of_the_map_is_refused(x: int, width: int) -> None:
    here = inputs("scan=")
    here.grids[0].take(map_of([[0, 0, 0]]), 10.0)
    here.build(10.0)
    update = TYPES.make(
        GRID_UPDATE,
        header=MAKE.header(EPOCH, "map"),
        x=x,
        y=0,
        width=width,
        height=1,
        data=np.zeros(2, dtype=np.int8),
    )
    here.grids[0].update(update, 11.0)
    assert here.problems(11.0)
