"""Drives of robots that do not see all around."""

import math

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.world.scan import Outlooks, outlook_of

REACH, QUARTER = 8.0, math.pi / 2


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
