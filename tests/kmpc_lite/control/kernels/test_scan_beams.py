"""Ranges of neighbouring beams, averaged over one surface."""

import numpy as np
import pytest

from kmpc_lite.control.kernels.scan_library import averaged_ranges

STEP = np.pi / 360
ALL = np.ones(720, dtype=bool)


def test_a_surface_nearby_is_known_better_than_by_one_beam() -> None:
    random = np.random.default_rng(4)
    ranges = 0.3 + 0.01 * random.normal(size=720)
    averaged, deviations = averaged_ranges(ranges, ALL, STEP, 0.01, 0.025)
    inner = slice(8, -8)
    assert deviations[inner] == pytest.approx(0.01 / np.sqrt(2.0))
    assert np.std(averaged[inner] - 0.3) < 0.004 < 0.009 < np.std(ranges)


def test_an_edge_is_not_mixed_with_what_lies_behind_it_nor_with_what_was_not_hit() -> None:
    ranges = np.where(np.arange(720) < 360, 0.3, 0.5)
    hits = ALL.copy()
    hits[:100] = False
    averaged, _ = averaged_ranges(ranges, hits, STEP, 0.01, 0.025)
    assert averaged == pytest.approx(ranges, abs=1e-7)


def test_the_first_and_the_last_beam_of_a_half_scan_are_no_neighbours() -> None:
    ranges = np.linspace(0.30, 0.31, 180)
    averaged, _ = averaged_ranges(ranges, np.ones(180, dtype=bool), STEP, 0.01, 0.025)
    assert averaged[0] < averaged[90] < averaged[-1]
    assert averaged[0] == pytest.approx(ranges[:9].mean(), abs=1e-6)
