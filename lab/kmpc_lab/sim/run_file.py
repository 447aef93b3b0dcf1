"""Runs as npz files: numbers and JSON, no pickle."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from firmware_bridge.recording.drive.seen import ranges_of, told_ranges
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.files import MAX_ARCHIVE_BYTES, read_npz, real_array, write_whole
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

LEAST, LARGEST = 1e-6, 1e6
"""Of a time that is not zero [s], and of all numbers of a drive [m, rad, s]."""
FORMAT, VERSION = "kmpc_lite.run", 1
ARRAYS = ("states", "path", "inputs", "plans", "step_times")
SCAN_ARRAYS = ("scan_times", "scan_ranges", "scanner")


def save_run(run: Run, path: Path) -> None:
    """Write a run, whole or not at all."""
    header = {
        "format": FORMAT,
        "version": VERSION,
        "name": run.scenario.name,
        "scenario": run.scenario.to_toml(),
        "dt": run.dt,
        "outcome": run.outcome.value,
        "duration": run.duration,
        "statuses": run.statuses,
        "clearance": run.clearance if np.isfinite(run.clearance) else None,
        "info": run.info,
        "errors": run.errors,
    }
    try:
        with write_whole(path) as file:
            arrays = {name: getattr(run, name) for name in ARRAYS}
            arrays |= scans_to_arrays(run.scans)
            np.savez_compressed(
                file, allow_pickle=False, header=np.array(json.dumps(header)), **arrays
            )
    except OSError as error:
        raise ScenarioError(f"{path}: cannot write the run: {error.strerror or error}") from error


def load_run(path: Path) -> Run:
    """Read a run; ScenarioError for anything else."""
    try:
        # a drive of a day takes more, but its plans are no zeros, which pack a thousand times
        most = max(MAX_ARCHIVE_BYTES, 20 * path.stat().st_size)
        arrays, _ = read_npz(path, ("header", *ARRAYS, *SCAN_ARRAYS), most)
    except OSError as error:
        raise ScenarioError(f"{path}: cannot read the run: {error.strerror or error}") from error
    except ValueError as error:
        raise ScenarioError(
            f"{path}: not a run that kmpc simulate wrote, or damaged: {error}"
        ) from error
    try:
        header = json.loads(str(arrays.pop("header")))
        if header["format"] != FORMAT or header["version"] != VERSION:
            raise ScenarioError(
                f"{path}: expected {FORMAT} version {VERSION}, "
                f"got {header['format']} version {header['version']}"
            )
        scenario = Scenario.from_table(
            parse_toml(str(header["scenario"])), _name(header["name"]), str(path)
        )
        statuses = _statuses(header["statuses"])
        return Run(
            scenario=scenario,
            dt=_number("dt", header["dt"], above_zero=True),
            outcome=Outcome(header["outcome"]),
            duration=_number("duration", header["duration"], above_zero=True),
            statuses=statuses,
            clearance=np.inf
            if header["clearance"] is None
            else _number("clearance", header["clearance"]),
            info=_table(header["info"]),
            errors=errors_of(header.get("errors")),
            scans=scans_of(arrays),
            **_checked(arrays, len(statuses)),
        )
    except ScenarioError:
        raise
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise ScenarioError(
            f"{path}: not a run that kmpc simulate wrote: {type(error).__name__} {error}"
        ) from error


def errors_of(told: Any) -> tuple[float, float] | None:
    """Errors that a drive reported: two numbers, or None."""
    if told is None:
        return None
    distance, turn = told
    return _number("errors", distance), _number("errors", turn)


def _number(name: str, value: Any, above_zero: bool = False) -> float:
    """Read a number in SI units that a drive can have."""
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not abs(value) <= LARGEST or (above_zero and not value >= LEAST):
        raise ValueError(f"{name}: expected a number{' > 0' * above_zero}, got {value!r:.40}")
    return float(value)


def _statuses(names: Any) -> tuple[str, ...]:
    known = {status.name for status in PlanStatus}
    if not isinstance(names, list) or not all(isinstance(n, str) and n in known for n in names):
        raise ValueError(f"statuses: expected a list of {', '.join(sorted(known))}")
    return tuple(names)


def _name(name: Any) -> str:
    if not isinstance(name, str):
        raise ValueError(f"name: expected a text, got {name!r:.40}")
    return name


def _table(info: Any) -> dict[str, Any]:
    if not isinstance(info, dict):
        raise ValueError("info: expected a table")
    return info


def _checked(arrays: dict[str, Array], steps: int) -> dict[str, Any]:
    """Arrays of a run of so many steps, real numbers in the shapes that `Run` tells."""
    checked = {name: real_array(arrays[name], name, ScenarioError) for name in ARRAYS}
    substeps = (len(checked["path"]) - 1) // max(steps, 1)
    stages = checked["plans"].shape[1] if checked["plans"].ndim == 3 else 0
    expected = {
        "states": (steps + 1, 3),
        "path": (substeps * steps + 1, 3),
        "inputs": (steps, 3 if checked["inputs"].shape[-1:] == (3,) else 2),
        "plans": (steps, stages, 3),
        "step_times": (steps,),
    }
    for name, shape in expected.items():
        if checked[name].shape != shape or not steps:
            raise ValueError(
                f"{name}: expected shape {shape} for {steps} steps, got {checked[name].shape}"
            )
        if not (np.abs(checked[name]) <= LARGEST).all():
            raise ValueError(f"{name}: expected finite numbers of at most {LARGEST:g}")
    return checked


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
