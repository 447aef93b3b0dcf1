"""An outline's distances from solids are the true ones, and so are their slopes by its pose."""

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control import Footprint
from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels.clearance import COLUMNS
from kmpc_lite.control.world.outlines import Outlines, outline_gaps
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.control.world.surroundings import Surroundings
from kmpc_lite.scenario.touch import footprint_gaps

OUTLINE = Footprint.rectangle(0.5, 0.36, ahead=-0.1)
SOLIDS = [
    kl.Polygon([(0.6, -1.0), (1.5, -0.4), (1.2, 0.8)]),
    kl.Polygon([(-1.2, -0.5), (-0.6, -0.5), (-0.6, 0.4), (-1.2, 0.4)]),
    kl.Wall(-1.0, 0.9, 1.0, 1.1, 0.04),
]


def gaps(poses: np.ndarray, count: int = 1) -> tuple[np.ndarray, np.ndarray]:
    return outline_gaps(Outlines.of(SOLIDS), OUTLINE, poses, count)


def test_the_nearest_points_are_the_robots_and_slopes_those_of_their_distances() -> None:
    poses = np.random.default_rng(4).uniform((-1.0, -1.0, -3.0), (1.0, 1.0, 3.0), (400, 3))
    truth = footprint_gaps(OUTLINE, poses, np.empty((400, 0, 3)), SOLIDS)
    poses, truth = poses[truth > 0.01], truth[truth > 0.01]
    found, slopes = gaps(poses, 3)
    np.testing.assert_allclose(found[:, 0].min(axis=1), truth, atol=1e-9)
    assert (np.diff(found, axis=1) >= 0.0).all()
    for axis, step in enumerate(1e-6 * np.eye(3)):
        told = (gaps(poses + step)[0] - gaps(poses - step)[0])[:, 0] / 2e-6
        # but where the nearest point changes
        assert np.isclose(told, slopes[:, 0, :, axis], atol=1e-4).mean() > 0.99


def test_no_clearance_grows_faster_than_the_robot_moves() -> None:
    """A slope of 16,000 between two sides made all but standing unsafe, for good."""
    car, half = Footprint.rectangle(0.618532, 0.257077, -0.2298), 0.21401776268342415
    lefts = -2.26 - half, half
    sides = [kl.Polygon([(a, 0), (a + 2.26, 0), (a + 2.26, 1.4), (a, 1.4)]) for a in lefts]
    pose = np.array((0.06868056100713991, -0.3350405601387271, 1.700317620071632))
    around = Surroundings(np.empty((0, COLUMNS)), Solids(sides).whole)
    x, y, _ = np.moveaxis(around.slopes(places_of(car, pose), pose, 1.5e-5, car), -1, 0)
    assert np.hypot(x, y).max() < 1.01
