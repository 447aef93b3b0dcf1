"""The simulated lidar: rays against dense samples of what they meet."""

import numpy as np
import pytest

from kmpc_lab.sim.lidar import LidarSpec, box_edges, scan_ranges
from kmpc_lite.scenario.world import World

NOTHING = np.empty((0, 5)), np.empty((0, 4))


def test_rays_end_where_dense_samples_say() -> None:
    random = np.random.default_rng(0)
    circles = np.column_stack(
        [random.uniform(-3, 3, (6, 2)), random.uniform(0.1, 0.4, 6), np.zeros((6, 2))]
    )
    edges = random.uniform(-3, 3, (6, 4))
    world, origin = World(circles, edges), np.array([0.05, -0.1])
    directions = random.uniform(-np.pi, np.pi, 60)
    ranges = world.ranges(origin, directions)
    for direction, distance in zip(directions, ranges, strict=True):
        along = np.array([np.cos(direction), np.sin(direction)])
        if np.isfinite(distance):
            end = origin + distance * along
            assert abs(world.clearance(end[None], np.zeros(1))[0]) < 1e-9
        steps = np.arange(0.0, min(distance, 5.0) - 0.002, 0.002)
        crossed = world.clearance(origin + steps[:, None] * along, np.zeros(len(steps)))
        outside = np.hypot(*(origin - circles[:, :2]).T) > circles[:, 2]
        assert outside.all() and crossed.min(initial=1.0) > 0.0


def test_circles_move_and_a_scanner_has_reach_noise_and_dropouts() -> None:
    world = World(np.array([(1.0, 0.0, 0.2, 0.5, 0.0)]), NOTHING[1])
    assert world.ranges(np.zeros(2), np.zeros(1), 1.0)[0] == pytest.approx(1.3)
    spec, random = LidarSpec(2.0, 4000, 0.01, 0.05), np.random.default_rng(0)
    ranges, directions = scan_ranges(
        World(NOTHING[0], box_edges(-1, -9, 1, 9)), spec, np.zeros(3), random
    )
    assert 0.04 < np.isnan(ranges).mean() < 0.06
    assert np.isinf(ranges).any() and not (ranges[np.isfinite(ranges)] > 2.0).any()
    ahead = np.abs(directions) < 0.1
    assert np.nanstd(ranges[ahead] * np.cos(directions[ahead])) == pytest.approx(0.01, rel=0.2)
