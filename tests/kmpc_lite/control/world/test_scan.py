"""Laser scans: what each beam tells, mounts, self-hits."""

from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl

QUARTER = np.pi / 2


def scan(ranges: Any, **options: Any) -> kl.LaserScan:
    usual = {"angle_min": 0.0, "angle_increment": QUARTER, "range_max": 4.0}
    return kl.LaserScan(ranges, **{**usual, **options})


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"ranges": ["a"]}, "real numbers"),
        ({"range_max": -1.0}, "range_max"),
        ({"mount": (0.0,)}, "mount"),
        ({"noise": -0.1}, "noise"),
        ({"age": -1.0}, "age"),
    ],
)
def test_scans_that_are_none_are_refused(options: dict[str, Any], words: str) -> None:
    with pytest.raises(kl.ProblemError, match=words):
        scan(**{"ranges": [1.0], **options})


def test_what_drivers_send_for_nothing_and_for_no_information() -> None:
    ranges = [1.0, np.inf, 4.0, np.nan, 0.0, -1.0, -np.inf, 0.1, 4.1, 1e300]
    seen = scan(ranges, range_min=0.2, angle_increment=0.1)
    assert np.flatnonzero(seen.hits).tolist() == [0]
    assert np.flatnonzero(seen.clear).tolist() == [1, 2]
    assert np.flatnonzero(seen.unknown).tolist() == list(range(3, 10))
    assert seen.reach.tolist() == [1.0, 4.0, 4.0] + 7 * [0.0]
    assert np.isfinite(seen.ends).all() and len(seen.points) == 1


def test_the_mount_moves_turns_and_mirrors_what_was_seen() -> None:
    ranges = [1.0, 2.0]
    np.testing.assert_allclose(scan(ranges).points, [(1, 0), (0, 2)], atol=1e-12)
    np.testing.assert_allclose(
        scan(ranges, angle_increment=-QUARTER).points, [(1, 0), (0, -2)], atol=1e-12
    )
    np.testing.assert_allclose(
        scan(ranges, mount=(0.5, 0.1, QUARTER)).points, [(0.5, 1.1), (-1.5, 0.1)], atol=1e-12
    )
    np.testing.assert_allclose(
        scan(ranges, mount=(0.5, 0.1, QUARTER), mirrored=True).points,
        [(0.5, 1.1), (2.5, 0.1)],
        atol=1e-12,
    )


def test_the_robots_own_mast_is_no_obstacle_and_hides_what_lies_behind() -> None:
    seen = scan([0.1, 0.1, np.inf, 1.0], mount=(0.2, 0.0), self_radius=0.25)
    assert seen.hits.tolist() == [True, False, False, True]
    assert seen.unknown.tolist() == [False, True, False, False]
    wider = seen.with_self_radius(0.35)
    assert wider.hits.tolist() == [False, False, False, True]
    assert seen.with_self_radius(0.1) is seen


def test_a_scan_does_not_change_with_the_callers_array() -> None:
    seen = scan(ranges := np.ones(3))
    ranges[0] = 9.0
    assert seen.ranges[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        seen.ranges[0] = 2.0
