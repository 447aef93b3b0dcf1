"""Drives by scans alone: what is not seen to be free is not driven into."""

from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lab.sim.lidar import LidarSpec, box_edges, scan_ranges
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

START, GOAL = np.array([-1.5, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
CIRCLES = np.array([(0.0, 0.05, 0.2, 0.0, 0.0), (0.6, -0.5, 0.15, 0.0, 0.0)])
WORLD = World(CIRCLES, box_edges(-2.2, -2.2, 2.2, 2.2))


def look(pose: Array, seed: int, world: World = WORLD, **options: Any) -> kl.LaserScan:
    spec = LidarSpec()
    ranges, directions = scan_ranges(world, spec, pose, np.random.default_rng(seed))
    return kl.LaserScan(ranges, directions[0], directions[1] - directions[0], spec.reach, **options)


def test_a_robot_drives_on_towards_a_goal_on_which_something_stands() -> None:
    controller, pose, stood = kl.Controller(kl.nominal_unicycle(0.1)), START, []
    taken = World(np.vstack([CIRCLES, (1.5, 0.0, 0.1, 0.0, 0.0)]), box_edges(-2.2, -2.2, 2.2, 2.2))
    for k in range(90):
        plan = controller.step(pose, GOAL, [look(pose, k, taken if k > 9 else WORLD)])
        pose = DifferentialDrive().trace(pose, plan.command, 0.1, 4)[-1]
        stood += [pose] if abs(plan.command[0]) < 0.05 else []
    assert np.hypot(*(stood[0] - GOAL)[:2]) < 0.5 and "the goal lies so near" in plan.reason


def test_plans_stay_within_what_was_seen_to_be_free() -> None:
    """A scanner of 0.6 m: no plan leads beyond."""
    controller = kl.Controller(kl.nominal_unicycle(0.1))
    for k in range(3):
        ranges, directions = scan_ranges(
            World(np.empty((0, 5)), np.empty((0, 4))),
            LidarSpec(reach=0.6),
            START,
            np.random.default_rng(k),
        )
        scan = kl.LaserScan(ranges, directions[0], directions[1] - directions[0], 0.6)
        plan = controller.step(START, GOAL, [scan])
    away = np.hypot(*(plan.states[:, :2] - START[:2]).T)
    assert 0.1 < away.max() <= 0.6 - 0.15 + 0.05


def test_a_mount_upside_down_and_turned_gives_the_same_drive() -> None:
    """Beams in the other order, from a scanner that stands askew: the same points."""
    plain = kl.Controller(kl.nominal_unicycle(0.1))
    turned = kl.Controller(kl.nominal_unicycle(0.1))
    pose = START
    for k in range(10):
        scan = look(pose, k)
        other = kl.LaserScan(
            scan.ranges[::-1],
            -scan.angle_min - scan.angle_increment * (len(scan) - 1) - 0.5 + 2.0,
            scan.angle_increment,
            scan.range_max,
            mount=(0.0, 0.0, 1.5),
            mirrored=True,
        )
        np.testing.assert_allclose(np.sort(other.points, axis=0), np.sort(scan.points, axis=0))
        plan, twin = (c.step(pose, GOAL, [s]) for c, s in ((plain, scan), (turned, other)))
        np.testing.assert_allclose(plan.command, twin.command, atol=1e-3)
        pose = plan.states[1]


def test_scans_stand_beside_other_obstacles_and_too_many_stop_the_robot() -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1))
    others = [kl.Circle(0.0, 0.5, 0.1), kl.Wall(-2.0, 2.0, 2.0, 2.0), look(START, 0)]
    assert controller.step(START, GOAL, others).status is not kl.PlanStatus.STOPPED
    controller.reset()
    plan = controller.step(START, GOAL, 11 * [look(START, 0)])
    assert plan.status is kl.PlanStatus.STOPPED and "11 scans" in plan.reason
