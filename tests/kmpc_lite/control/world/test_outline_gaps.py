"""An outline's distances from solids are the true ones, and so are their slopes by its pose."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control import Footprint
from kmpc_lite.control.world.outline_gaps import outline_gaps
from kmpc_lite.control.world.outlines import Outlines
from kmpc_lite.scenario.touch import footprint_gaps

OUTLINE = Footprint.rectangle(0.5, 0.36, ahead=-0.1)
SOLIDS = [
    kl.Polygon([(0.6, -1.0), (1.5, -0.4), (1.2, 0.8)]),
    kl.Polygon([(-1.2, -0.5), (-0.6, -0.5), (-0.6, 0.4), (-1.2, 0.4)]),
    kl.Wall(-1.0, 0.9, 1.0, 1.1, 0.04),
]


def gaps(poses: np.ndarray, count: int = 1) -> tuple[np.ndarray, np.ndarray]:
    return outline_gaps(Outlines.of(SOLIDS), OUTLINE, poses, count)


def clear_poses() -> np.ndarray:
    poses = np.random.default_rng(4).uniform((-1.0, -1.0, -3.0), (1.0, 1.0, 3.0), (400, 3))
    return poses[footprint_gaps(OUTLINE, poses, np.empty((400, 0, 3)), SOLIDS) > 0.01]


def test_the_nearest_point_is_the_robots_distance() -> None:
    poses = clear_poses()
    found, _ = gaps(poses, 3)
    truth = footprint_gaps(OUTLINE, poses, np.empty((len(poses), 0, 3)), SOLIDS)
    np.testing.assert_allclose(found[:, 0].min(axis=1), truth, atol=1e-9)
    assert (np.diff(found, axis=1) >= 0.0).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_slopes_are_those_of_the_distances(axis: int) -> None:
    poses, step = clear_poses(), np.zeros(3)
    step[axis] = 1e-6
    before, after = gaps(poses - step)[0], gaps(poses + step)[0]
    _, slopes = gaps(poses)
    told = (after - before)[:, 0] / 2e-6
    # but where the nearest point changes
    assert np.isclose(told, slopes[:, 0, :, axis], atol=1e-4).mean() > 0.99
