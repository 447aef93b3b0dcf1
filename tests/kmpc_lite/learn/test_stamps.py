"""Stamps of a busy recorder, and stamps that tell when a pose was measured."""

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows

from kmpc_lite.learn.cutting import even_stamps
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.logs import Log, Series
from kmpc_lite.types import Array

RATE = 20.0


def log_of(table: Array) -> Log:
    """A log of rows t, x, y, theta, v, omega."""
    poses = Series(table[:, 0], table[:, 1:4], "run")
    return Log("run", poses, Series(table[:, 0], table[:, 4:], "run"), together=True)


def late(seconds: float, seed: int = 0, noise: float = 0.002) -> tuple[Array, Array]:
    """Rows that were measured evenly, with the stamps of a recorder that comes late to each."""
    table, random = rows(drive(120.0, rate=RATE, delay=0.2, hold=1.5)), np.random.default_rng(seed)
    table[:, 1:4] += noise * random.normal(size=(len(table), 3))
    written = table[:, 0] + random.exponential(seconds, len(table))
    return table[:, 0], np.column_stack([np.maximum.accumulate(written), table[:, 1:]])


@pytest.mark.parametrize("seconds", [0.01, 0.03])
def test_stamps_of_a_busy_recorder_are_made_even(seconds: float) -> None:
    measured, table = late(seconds)
    table[:, 0] += 1e-6 * np.arange(len(table))
    log = even_stamps(log_of(table))
    (note,) = log.notes
    assert "the recorder was busy" in note
    before, after = (t - measured - np.mean(t - measured) for t in (table[:, 0], log.poses.time))
    assert np.std(after) < 0.3 * np.std(before)
    np.testing.assert_array_equal(log.commands.time, log.poses.time)
    assert (np.diff(log.poses.time) > 0.0).all()


def test_a_busy_recorder_hides_neither_lag_nor_accuracy(tmp_path: Path) -> None:
    measured, table = late(0.03)
    table[:, 0] += 1e-6 * np.arange(len(table))
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
