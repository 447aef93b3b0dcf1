"""Drives of robots that do not see all around."""

from __future__ import annotations

import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.lidar import box_edges
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.path.progress import ProgressState
from kmpc_lite.control.world.sight.local_map import UNKNOWN, LocalMap
from kmpc_lite.control.world.sight.outlook import Outlooks, outlook_of
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

ROOM = World(edges=box_edges(0.0, 0.0, 7.0, 4.0))
AREA = {"x_min": (-0.3, -0.3, -np.inf), "x_max": (7.3, 4.3, np.inf)}
REACH, QUARTER = 8.0, math.pi / 2


def scan_from(pose: Array, view: float, mount: tuple[float, float, float], k: int) -> kl.LaserScan:
    """What a scanner with a field of view [rad] sees of the room."""
    count = round(math.degrees(view)) + 1 - (view >= math.tau)
    step = math.pi / 180
    begin = -0.5 * view
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    place = pose[:2] + (cos * mount[0] - sin * mount[1], sin * mount[0] + cos * mount[1])
    ranges = ROOM.ranges(place, pose[2] + mount[2] + begin + step * np.arange(count))
    ranges = ranges + 0.01 * np.random.default_rng(k).normal(size=count)
    return kl.LaserScan(np.minimum(ranges, REACH), begin, step, REACH, mount=mount)


def depth_in_unknown(here: LocalMap, pose: Array, states: Array) -> float:
    """How much deeper states (K, 3) reach into unknown cells than the robot does where it is."""
    row, column = np.nonzero(here.state == UNKNOWN)
    low = here.cell * np.stack([column + here.column, row + here.row], axis=1)
    low = low[(np.abs(low - pose[:2]) < 3.0).all(axis=1)]

    def least(point: Array) -> float:
        return float(np.hypot(*(np.clip(point, low, low + here.cell) - point).T).min(initial=1.0))

    return min(least(pose[:2]), 0.15) - min(least(state[:2]) for state in states)


@pytest.mark.parametrize(
    ("view", "goal_x", "heading", "most"),
    [(QUARTER, 5.0, 2.6, 22.0), (math.pi, 5.0, math.pi, 18.0), (1.5 * math.pi, 2.5, 2.6, 12.0)],
)
def test_a_robot_turns_round_to_see_what_lies_behind_it(
    view: float, goal_x: float, heading: float, most: float
) -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1), kl.NavigationProblem(**AREA))  # type: ignore[arg-type]
    pose, goal, depth = np.array([1.0, 2.0, heading]), (goal_x, 2.0, math.pi), -1.0
    for k in range(round(most / 0.1)):
        plan = controller.step(pose, goal, [scan_from(pose, view, (0.1, 0.0, 0.0), k)])
        here = controller.state.seen
        assert here is not None
        depth = max(depth, depth_in_unknown(here, pose, plan.states))
        if plan.holding:
            break
        pose = DifferentialDrive().trace(pose, plan.command, 0.1, 4)[-1]
    assert plan.holding
    assert here is not None and depth < here.cell


def test_a_robot_that_cannot_back_up_looks_to_either_side_before_it_sets_off() -> None:
    """A camera of 90 degrees before its middle does not see what stands beside the robot."""
    problem = kl.NavigationProblem(u_min=(0.0, -np.pi / 4), **AREA)  # type: ignore[arg-type]
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem)
    pose = np.array([1.0, 2.0, QUARTER])
    for k in range(180):
        plan = controller.step(
            pose, (5.0, 2.0, math.pi), [scan_from(pose, QUARTER, (0.1, 0.0, 0.0), k)]
        )
        if plan.holding:
            break
        pose = DifferentialDrive().trace(pose, plan.command, 0.1, 4)[-1]
    assert plan.holding


@pytest.mark.parametrize("free_at_start", [0.0, 1.0])
def test_a_robot_with_corners_is_told_that_nothing_stands_beside_it(free_at_start: float) -> None:
    """A camera at its front edge does not see what its corners sweep."""
    sight = SightOptions(free_at_start=free_at_start)
    problem = kl.NavigationProblem(footprint=kl.Footprint.rectangle(0.4, 0.25), **AREA)  # type: ignore[arg-type]
    controller = kl.Controller(
        kl.nominal_unicycle(0.1), problem, options=kl.ControllerOptions(sight=sight)
    )
    pose, mount = np.array([2.0, 2.0, 0.0]), (0.2, 0.0, 0.0)
    for k in range(200):
        plan = controller.step(pose, (2.0, 3.5, QUARTER), [scan_from(pose, QUARTER, mount, k)])
        if plan.holding:
            break
        pose = DifferentialDrive().trace(pose, plan.command, 0.1, 4)[-1]
    assert plan.holding is bool(free_at_start)
    if not free_at_start:
        assert plan.progress is kl.GoalProgress.WAITING
        assert "sight.free_at_start" in plan.reason


@pytest.mark.parametrize(("mounted", "sense"), [(0.0, 1.0), (math.pi, -1.0)])
def test_a_robot_drives_in_the_gear_in_which_it_sees(mounted: float, sense: float) -> None:
    """A goal a long way ahead of it or behind it, aside: either gear takes about as long."""
    controller = kl.Controller(kl.nominal_unicycle(0.1), kl.NavigationProblem(**AREA))  # type: ignore[arg-type]
    pose, driven = np.array([1.0, 2.0, QUARTER]), 0.0
    for k in range(80):
        mount = (0.0, 0.0, mounted)
        plan = controller.step(pose, (6.0, 2.0, QUARTER), [scan_from(pose, QUARTER, mount, k)])
        driven += 0.1 * plan.command[0]
        pose = DifferentialDrive().trace(pose, plan.command, 0.1, 4)[-1]
    assert sense * driven > 1.5


# -- where scanners look


def outlook(
    count: int, begin: float, step: float, **more: object
) -> tuple[float, float, float, float] | None:
    scan = kl.LaserScan(np.ones(count), begin, step, 4.0, **more)  # type: ignore[arg-type]
    return outlook_of(scan)


def test_a_scanner_looks_where_its_beams_point() -> None:
    degree = math.pi / 180
    ahead = outlook(91, -45 * degree, degree, mount=(0.1, 0.0, 0.5))
    assert ahead == pytest.approx((0.1, 0.0, 0.5, 45 * degree))
    hung = outlook(91, 0.0, degree, mirrored=True)
    assert hung == pytest.approx((0.0, 0.0, -45 * degree, 45 * degree))
    around = outlook(360, -math.pi, degree)
    assert around is not None and around[3] == math.pi
    mast = outlook(360, -math.pi, degree, ignore=[(3.0, -3.0)])
    assert mast is not None and mast[3] == pytest.approx(3.0, abs=2 * degree)
    assert outlook(3, 0.0, degree, ignore=[(-1.0, 1.0)]) is None


def test_two_scanners_may_see_all_around_together() -> None:
    front, rear = (0.1, 0.0, 0.0, 1.6), (-0.1, 0.0, math.pi, 1.6)
    assert Outlooks(np.array([front])).is_narrow
    assert not Outlooks(np.array([front, rear])).is_narrow
    assert not Outlooks(np.empty((0, 4))).is_narrow
    beyond = Outlooks(np.array([front])).beyond(np.array([0.0, 1.5, 2.6, math.pi]))
    np.testing.assert_allclose(beyond, (0.0, 0.0, 1.0, math.pi - 1.6))


def test_a_turn_faces_what_is_not_looked_at() -> None:
    eyes = Outlooks(np.array([(0.0, 0.0, 0.0, 0.8)]))
    points = np.array([(1.0, 0.0), (0.0, 1.0), (-1.0, -0.1), (0.8, 0.7)])
    turns = eyes.turns(np.zeros(3), points, 0.1)
    # the last one lies within the outermost of what is seen
    wanted = math.pi / 2, math.atan2(-0.1, -1.0), math.atan2(0.7, 0.8)
    np.testing.assert_allclose(turns, wanted)


def test_a_robot_that_drives_a_detour_gets_on() -> None:
    drives = ProgressState(worst_left=20.0, waited=0.2)
    assert drives.gets_on(18.0) and not drives.gets_on(19.5)
    assert not ProgressState(worst_left=20.0, waited=3.0).gets_on(18.0)
