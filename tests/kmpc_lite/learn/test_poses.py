"""Poses that jump, come seldom or stand still are reported, and those of sound logs are not."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows
from valid_logs import KINDS, as_log, valid

from kmpc_lite.cli import main as cli
from kmpc_lite.learn.cutting import cut, even_stamps
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.loading import load_logs, tell_poses
from kmpc_lite.types import Array

TABLE = rows(drive(120.0, rate=50.0, noise=(0.002, 0.002)))


@pytest.mark.parametrize("kind", KINDS)
def test_poses_of_sound_logs_are_not_remarked_on(kind: str) -> None:
    for seed in (2001, 2002, 2003):
        assert tell_poses(valid(seed, kind).log, 0.2) == []


def outlier(table: np.ndarray) -> np.ndarray:
    table[700, 1] += 1.5
    return table


def moved_frame(table: np.ndarray) -> np.ndarray:
    table[700:, 1:3] += table[600, 1:3] - table[700, 1:3] + 1.0
    table[600:700, 1:], table[700, 4] = (*table[600, 1:4], 0.0, 0.0), 40.0  # measured at rest
    return table


def bad_heading(table: np.ndarray) -> np.ndarray:
    table[700:702, 3] += 2.0
    return table


def seldom(table: np.ndarray) -> np.ndarray:
    table[:, 1:4] = table[np.arange(len(table)) // 20 * 20, 1:4]
    return table


def lost(table: np.ndarray) -> np.ndarray:
    table[700:1200, 1:4] = table[700, 1:4]
    return table


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (outlier, "row 70[01]: the position jumps by 1.5 m in 0.02 s .2 such jumps"),
        (moved_frame, "row 700: the position jumps by 1.4"),
        (bad_heading, "row 70[02]: the heading jumps by [12]"),
        (seldom, "change every 0.4 s only, though logged every 0.02 s"),
        (lost, "row 700: the pose does not change for 10 s"),
    ],
)
def test_what_is_wrong_with_poses_is_reported_with_its_size(
    change: Callable[[np.ndarray], np.ndarray], words: str
) -> None:
    told = tell_poses(as_log(change(TABLE.copy())), 0.1)
    assert any(re.search(words, line) for line in told), told
    parts = cut(as_log(change(TABLE.copy())), 0.1)
    assert (len(parts) > 1) == (change is not seldom)  # lost, it is elsewhere afterwards
    assert all(np.abs(part.inputs).max() < 2.0 for part in parts)


def test_inspect_and_fit_report_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = _saved(tmp_path / "run.csv", outlier(TABLE.copy()))
    for command in (["inspect", str(made)], ["fit", str(made), "-o", str(tmp_path / "m.npz")]):
        assert cli.main(command) == 0
        told = capsys.readouterr().out
        assert re.search("line 70[23]: the position jumps by 1.5 m", told), told


def late(seconds: float, seed: int = 0, noise: float = 0.002) -> tuple[Array, Array]:
    """Rows that were measured evenly, with the stamps of a recorder that comes late to each."""
    table, random = rows(drive(120.0, rate=20.0, delay=0.2, hold=1.5)), np.random.default_rng(seed)
    table[:, 1:4] += noise * random.normal(size=(len(table), 3))
    written = np.maximum.accumulate(table[:, 0] + random.exponential(seconds, len(table)))
    in_order = written + 1e-6 * np.arange(len(table))
    return table[:, 0], np.column_stack([in_order, table[:, 1:]])


@pytest.mark.parametrize("seconds", [0.01, 0.03])
def test_stamps_of_a_busy_recorder_are_made_even(seconds: float) -> None:
    measured, table = late(seconds)
    log = even_stamps(as_log(table))
    (note,) = log.notes
    assert "the recorder was busy" in note
    before, after = (t - measured - np.mean(t - measured) for t in (table[:, 0], log.poses.time))
    assert np.std(after) < 0.3 * np.std(before)
    np.testing.assert_array_equal(log.commands.time, log.poses.time)
    assert (np.diff(log.poses.time) > 0.0).all()


def test_a_busy_recorder_hides_neither_lag_nor_accuracy(tmp_path: Path) -> None:
    measured, table = late(0.03)
    told: list[str] = []
    file = _saved(tmp_path / "busy.csv", table)
    busy = fit(load_logs([file], 0.1, tell=told.append), lags="auto")
    assert any("the recorder was busy" in line for line in told)
    table[:, 0] = measured
    quiet = fit(load_logs([_saved(tmp_path / "quiet.csv", table)], 0.1), lags="auto")
    mended, best = (sum(m.info["response"]["speed"]) for m in (busy, quiet))
    assert mended == pytest.approx(best, abs=0.03)
    errors = [float(np.sqrt(m.noise(np.array((0.5, 0.0)))[0, 0])) for m in (busy, quiet)]
    assert errors[0] < 1.5 * errors[1]


def _saved(file: Path, table: Array) -> Path:
    np.savetxt(file, table, "%.7f", ",", header="t,x,y,theta,v,omega", comments="")
    return file
