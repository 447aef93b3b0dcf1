"""Scans of a run as three arrays of its file, and back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.files import real_array
from kmpc_lite.types import Array

SCAN_ARRAYS = ("scan_times", "scan_ranges", "scanner")
NOTHING, CLEAR = -1.0, -2.0
"""Ranges that no sensor measures: a beam that tells nothing, and one that met nothing."""


def told_ranges(scan: LaserScan) -> Array:
    """Ranges (B,) of a scan as finite numbers [m]; `NOTHING` and `CLEAR` stand in for others."""
    told: Array = np.where(scan.hits, scan.ranges, np.where(scan.clear, CLEAR, NOTHING))
    return told


def ranges_of(told: Array) -> Array:
    """Ranges as `LaserScan` takes them, of what `told_ranges` gave."""
    ranges: Array = np.where(told == CLEAR, np.inf, np.where(told < 0.0, np.nan, told))
    return ranges


def scans_to_arrays(scans: Sequence[tuple[float, LaserScan]]) -> dict[str, Array]:
    """Arrays of scans of one scanner; none without scans.

    They hold what counts: limits, ignored sectors and the robot itself are in the ranges already,
    and a scanner that is mounted upside down is one that turns the other way.
    """
    if not scans:
        return {}
    first = scans[0][1]
    sense = -1.0 if first.mirrored else 1.0
    ranges = [told_ranges(scan) for _, scan in scans]
    angles = sense * first.angle_min, sense * first.angle_increment
    geometry = (*angles, first.range_max, *first.mount)
    made = (np.array([time for time, _ in scans]), np.array(ranges, np.float32), np.array(geometry))
    return dict(zip(SCAN_ARRAYS, made, strict=True))


def scans_of(arrays: Mapping[str, Any]) -> tuple[tuple[float, LaserScan], ...]:
    """Scans of what a file holds; ValueError for what `scans_to_arrays` does not write."""
    if not set(SCAN_ARRAYS) <= arrays.keys():
        return ()
    times, ranges, scanner = (real_array(arrays[n], n, ScenarioError) for n in SCAN_ARRAYS)
    if ranges.ndim != 2 or times.shape != (len(ranges),) or scanner.shape != (6,):
        raise ValueError("scans: expected times (S,), ranges (S, B) and the scanner (6,)")
    if not all(np.isfinite(part).all() for part in (times, ranges, scanner)):
        raise ValueError("scans: expected finite numbers")
    start, step, reach, *mount = scanner.tolist()
    return tuple(
        (time, LaserScan(row, start, step, reach, mount=mount))
        for time, row in zip(times.tolist(), ranges_of(ranges), strict=True)
    )
