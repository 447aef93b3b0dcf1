"""Outlines of what a scan saw to be free."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.recording.seen import BEAMS, CORNERS, hits, outline


def test_an_outline_ends_at_what_was_hit_and_at_the_reach():
    ranges = np.full(360, np.inf)
    ranges[170:191] = 1.0  # a wall ahead
    ranges[180] = np.nan  # a beam that did not come back
    scan = kl.LaserScan(ranges, -np.pi, np.pi / 180, 4.0, mount=(0.2, 0.0, 0.0))
    corners = outline(scan)
    assert corners.shape == (CORNERS + 1, 2)
    away = np.hypot(corners[:, 0] - 0.2, corners[:, 1])
    ahead = np.abs(np.arctan2(corners[:, 1], corners[:, 0] - 0.2)) < np.radians(8.0)
    np.testing.assert_allclose(away[ahead], 1.0)
    assert np.isclose(away, 4.0).sum() > 0.9 * CORNERS
    np.testing.assert_allclose(corners[0], corners[-1])  # all around: there is no seam


@pytest.mark.parametrize(("beams", "mirrored"), [(1, False), (37, True), (1440, False)])
def test_scanners_of_any_sort_have_one(beams, mirrored):
    scan = kl.LaserScan(np.full(beams, 2.0), -1.0, 2.0 / beams, 4.0, mirrored=mirrored)
    corners = outline(scan)
    assert np.isfinite(corners).all() and not corners[0].any()
    np.testing.assert_allclose(np.hypot(*corners[1:].T), 2.0)
    assert (np.diff(np.arctan2(*corners[1:].T[::-1])) * (-1 if mirrored else 1) > -1e-9).all()
    assert len(hits(scan)) <= BEAMS


def test_what_tells_nothing_is_not_free():
    corners = outline(kl.LaserScan(np.full(40, np.nan), 0.0, 0.1, 4.0))
    assert not corners.any()
