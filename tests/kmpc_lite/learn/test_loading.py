"""Both doors to a log, the command's and the function's, check what comes in."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.learn.loading import load_logs
from kmpc_lite.learn.logs import ReadOptions

HEADER = "t,x,y,theta,v,omega"
SUSPECT = {
    "t is in ms": [1e3, 1, 1, 1, 1, 1],
    "theta is in degrees": [1, 1, 1, 180 / np.pi, 1, 1],
    "omega > 0 lowers theta": [1, 1, 1, 1, 1, -1],
}


@pytest.fixture
def table(tmp_path: Path) -> np.ndarray:
    robot = kmpc_lab.DifferentialDrive(slip=0.1, seed=2)
    data = kmpc_lab.generate_dataset(robot, episodes=10, steps=100, dt=0.1, seed=2)
    data.save(tmp_path / "good.csv")
    return np.genfromtxt(tmp_path / "good.csv", delimiter=",", skip_header=1)


@pytest.mark.parametrize("reason", SUSPECT)
def test_a_suspect_log_is_refused_by_both_doors_and_taken_by_both_if_forced(
    table: np.ndarray, tmp_path: Path, reason: str
) -> None:
    path = tmp_path / "run.csv"
    np.savetxt(path, table * SUSPECT[reason], delimiter=",", header=HEADER, comments="")
    for load in (lambda: kl.Dataset.load(path), lambda: load_logs([path])):
        with pytest.raises(kl.DataError, match=reason):
            load()
    one, other = (
        kl.Dataset.load(path, dt=0.1, force=True),
        load_logs([path], 0.1, how=ReadOptions(force=True)),
    )
    assert one.steps == other.steps > 0
    for mine, theirs in zip(one.episodes, other.episodes, strict=True):
        np.testing.assert_array_equal(mine.states, theirs.states)
        np.testing.assert_array_equal(mine.inputs, theirs.inputs)
