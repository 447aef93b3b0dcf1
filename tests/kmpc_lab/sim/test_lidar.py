"""The simulated lidar: rays against dense samples of what they meet."""

import numpy as np

from kmpc_lite.scenario.world import World


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
