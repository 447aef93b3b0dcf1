"""Paths of robots that turn on the spot: exact around one obstacle, clear of many, or none."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from path_requests import found, request

import kmpc_lite as kl
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.grid_planner import NO_WAY, GridPlanner
from kmpc_lite.control.path.planner import Path, Route, TimedPath
from kmpc_lite.control.path.ways import outline_distances

PROBLEM = kl.NavigationProblem()
WIDE = 0.06  # the clearance that is tried first [m]
SPEED = np.array([0.6, 0.7])
ASKED = partial(request, area=math.inf, turn=SPEED[1])


def search(asked) -> Path | str:
    return found(GridPlanner(PROBLEM, GuidanceOptions()), asked)


def test_around_one_circle_a_path_is_two_tangents_and_an_arc() -> None:
    path = search(ASKED((-2, 0.05, 0), (2, 0.05, 0), [(0, 0, 0.3)]))
    assert isinstance(path, Path)
    radius = 0.3 + PROBLEM.inflation + WIDE
    away = math.hypot(2, 0.05)
    turn = math.pi - 2 * math.acos(radius / away) - 2 * math.atan(0.05 / 2)
    shortest = 2 * math.sqrt(away**2 - radius**2) + radius * turn
    length = np.hypot(*np.diff(path.poses[:, :2], axis=0).T).sum()
    assert shortest - 0.005 < length < 1.05 * shortest
    assert (path.poses[:, 1] > -1e-9).all()
    assert path.clearance == pytest.approx(WIDE)


@pytest.mark.parametrize("seed", range(12))
def test_a_path_keeps_its_clearance_and_ends_in_the_poses_asked_for(seed: int) -> None:
    random = np.random.default_rng(seed)
    circles = np.column_stack([random.uniform(0, 4, (14, 2)), random.uniform(0.1, 0.3, 14)])
    solids = [kl.Wall(*random.uniform(1, 3, 4)), kl.Polygon([(1, 2), (1.4, 2), (1.2, 2.5)])]
    cells = random.random((20, 20)) < 0.03
    start, goal = (-0.6, -0.6, random.uniform(-3, 3)), (4.6, 4.6, random.uniform(-3, 3))
    grid = kl.OccupancyGrid(cells * 100, 0.1, (1.0, 1.0, 0.3))
    asking = ASKED(start, goal, circles, [*solids, grid])
    path = search(asking)
    assert isinstance(path, Path)
    np.testing.assert_allclose(path.poses[0], start, atol=1e-9)
    np.testing.assert_allclose(path.poses[-1, :2], goal[:2], atol=1e-9)
    assert math.cos(path.poses[-1, 2] - goal[2]) == pytest.approx(1.0)
    timed = TimedPath(path, SPEED)
    places = timed.at(np.arange(0.0, timed.duration, 0.02))[:, :2]
    # cells are cut by 2 cm at the most
    least = PROBLEM.inflation + path.clearance - 0.025
    assert asking.distances(places).min() >= least


def test_of_two_passages_the_wide_one_is_taken_and_the_narrow_one_where_there_is_no_other() -> None:
    half = PROBLEM.inflation + 0.2 * WIDE
    wall = [kl.Wall(0, -9, 0, -half), kl.Wall(0, half, 0, 0.4), kl.Wall(0, 1.1, 0, 9)]
    path = search(ASKED((-1, 0, 0), (1, 0, 0), (), wall, area=8.0))
    assert path.clearance == pytest.approx(WIDE)
    wall[2] = kl.Wall(0, 0.4, 0, 9)
    path = search(ASKED((-1, 0, 0), (1, 0, 0), (), wall, area=8.0))
    assert 0.0 < path.clearance < WIDE
    assert np.abs(path.poses[:, 1]).max() < 0.05
    wall[0] = kl.Wall(0, -9, 0, half)
    assert search(ASKED((-1, 0, 0), (1, 0, 0), (), wall, area=8.0)) == NO_WAY


def test_what_lies_far_away_makes_the_grid_no_coarser() -> None:
    half = PROBLEM.inflation + 2 * WIDE
    wall = [kl.Wall(0, -4, 0, -half), kl.Wall(0, half, 0, 4)]
    far = np.column_stack([np.linspace(-900, 900, 50), np.full(50, 900.0), np.full(50, 0.2)])
    path = search(ASKED((-1, 0, 0), (1, 0, 0), far, wall))
    assert np.abs(path.poses[:, 1]).max() < 0.05
    # a wall that is longer than what is looked at first is driven around
    path = search(ASKED((-1, 0, 0), (1, 0, 0), (), [kl.Wall(0, -40, 0, 9)]))
    assert path.poses[:, 1].max() > 9.0


@pytest.mark.parametrize("blocked", [False, True])
def test_where_the_path_driven_is_blocked_a_narrow_one_beside_it_is_no_detour(blocked) -> None:
    half = PROBLEM.inflation + 0.6 * WIDE
    wall = [kl.Wall(0, -9, 0, -half), kl.Wall(0, half, 0, 0.6), kl.Wall(0, 1.2, 0, 3)]
    asked = ASKED((-1, 0, 0), (1, 0, 0), (), [*wall, *blocked * [kl.Wall(0, 0.6, 0, 3)]], area=8.0)
    points = np.array([(-1, 0), (-0.2, 0.9), (0.2, 0.9), (1, 0)], dtype=float)
    driven = Route(points, reverse=False, clearance=WIDE, lost=0.0)
    path = search(replace(asked, driven=driven))
    assert path.switched is blocked
    assert bool(np.abs(path.poses[:, 1]).max() < 0.1) is blocked


@pytest.mark.parametrize("ahead", [(), (0.25, 0.02, 0.05), (-0.26, 0.02, 0.05)])
def test_what_sticks_out_turns_where_it_has_room(ahead: tuple[float, ...]) -> None:
    outline = kl.Footprint.rectangle(0.3, 0.2)
    planner = GridPlanner(kl.NavigationProblem(footprint=outline), GuidanceOptions())
    posts = [(-0.15, -0.17, 0.03), *([ahead] if ahead else [])]
    asked = ASKED((0, 0, 0), (0, 1.5, 1.6), posts, footprint=outline)
    poses = found(planner, asked).poses
    first = int(np.flatnonzero(np.abs(np.diff(poses[:, 2])) > 0.5)[0])
    assert np.allclose(poses[first, :2], poses[first + 1, :2]) and abs(poses[first, 1]) < 1e-9
    turn = np.linspace(poses[first], poses[first + 1], 50)
    assert outline_distances(asked, turn).min() > 0.01
