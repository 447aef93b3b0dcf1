"""A map that grows: a path is kept where something new stands elsewhere."""

import numpy as np

import kmpc_lite as kl

GOAL = (1.6, -1.5, 0.0)


def grid() -> kl.OccupancyGrid:
    cells = np.zeros((80, 80), dtype=int)
    cells[40:44, 10:70:6] = 100
    cells[50, 5:75:2] = 100
    return kl.OccupancyGrid(cells, 0.05, (-2.0, -2.0))


def test_a_path_is_kept_where_something_shows_up_elsewhere() -> None:
    controller, map_ = kl.Controller(kl.nominal_unicycle(0.1)), grid()
    pose = np.array([-1.6, -1.5, 0.0])
    for _ in range(3):
        pose = controller.step(pose, GOAL, [map_]).states[1]
    guide = controller.state.guide
    assert guide is not None and guide.path is not None
    path = guide.path
    elsewhere = map_.update(np.full((4, 4), 100), row=70, column=40)
    plan = controller.step(pose, GOAL, [elsewhere])
    assert guide.path is path and guide.search is not None and not guide.urgent
    for _ in range(12):
        plan = controller.step(plan.states[1], GOAL, [elsewhere])
    assert guide.search is None and guide.path is path


def test_another_path_is_found_at_once_where_something_stands_on_it() -> None:
    controller, map_ = kl.Controller(kl.nominal_unicycle(0.1)), grid()
    pose = np.array([-1.6, -1.5, 0.0])
    for _ in range(3):
        pose = controller.step(pose, GOAL, [map_]).states[1]
    guide = controller.state.guide
    assert guide is not None
    path = guide.path
    blocked = map_.update(np.full((6, 6), 100), row=8, column=38)
    controller.step(pose, GOAL, [blocked])
    assert guide.path is not path and guide.search is None
