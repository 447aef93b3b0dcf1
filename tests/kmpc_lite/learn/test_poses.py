"""Poses that jump, come seldom or stand still are reported, and those of sound logs are not."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows
from valid_logs import KINDS, as_log, valid

from kmpc_lite.cli import main as cli
from kmpc_lite.learn.cutting import cut
from kmpc_lite.learn.loading import tell_poses

TABLE = rows(drive(120.0, rate=50.0, noise=(0.002, 0.002)))


@pytest.mark.parametrize("kind", KINDS)
def test_poses_of_sound_logs_are_not_remarked_on(kind: str) -> None:
    for seed in (2001, 2002, 2003):
        assert tell_poses(valid(seed, kind).log, 0.2) == []


def outlier(table: np.ndarray) -> np.ndarray:
    table[700, 1] += 1.5
    return table


def moved_frame(table: np.ndarray) -> np.ndarray:
    table[700:, 1:3] += 1.0
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
    parts = len(cut(as_log(change(TABLE.copy())), 0.1))
    assert parts == 1 if "jumps" not in words else parts > 1


def test_inspect_and_fit_report_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    made = tmp_path / "run.csv"
    np.savetxt(
        made, outlier(TABLE.copy()), delimiter=",", header="t,x,y,theta,v,omega", comments=""
    )
    for command in (["inspect", str(made)], ["fit", str(made), "-o", str(tmp_path / "m.npz")]):
        assert cli.main(command) == 0
        told = capsys.readouterr().out
        assert re.search("line 70[23]: the position jumps by 1.5 m", told), told
