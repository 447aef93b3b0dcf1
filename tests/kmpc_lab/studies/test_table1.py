"""Table 1: its cells, and the paper's figures beside them."""

from dataclasses import replace
from pathlib import Path

import pytest

from kmpc_lab.studies import maps
from kmpc_lab.studies.catalogue import STUDIES
from kmpc_lab.studies.contenders import train
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.table1 import drive, render
from kmpc_lite.scenario.files import Scenario

SLIPS = STUDIES["table1"].axes["slips"].values
REST = ("ideal_seconds", "fastest", "jerk", "stopped", "fallback", "feasible", "step_p50")
OTHERS = {**dict.fromkeys(REST, 1.0), "gear_changes": 0, "step_p99": 1.0, "ended": ""}
DRIVE = DriveResult(True, False, 6.54, clearance=0.1, **OTHERS)
FULL, PAPERS = "ours, everything on", "ours, paper's formulation"


@pytest.mark.parametrize(("label", "slip"), [(FULL, "0.15 trained at 0.1"), (PAPERS, "0")])
def test_a_trial_is_driven_with_a_model_of_its_slip(
    label: str, slip: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(maps, "train", lambda slip, method, *_: train(slip, method, 20, 60))
    short = replace(Scenario.load("mehrez"), goal=(0.6, 0.0, 0.0), timeout=6.0)
    (tmp_path / "short.toml").write_text(short.to_toml())
    row = drive(label, slip, str(tmp_path / "short.toml"), 3)
    assert row.arrived and 0.5 < row.seconds < 6.0 and row.peer == (label == PAPERS)


def cells_of(label: str, collisions: int) -> list[DriveResult]:
    touched = replace(DRIVE, arrived=False, collided=True, seconds=1.23, clearance=-0.004)
    return [
        replace(touched if i < collisions else DRIVE, axes=(label, str(slip), "map"), seed=i)
        for slip in SLIPS
        for i in range(5)
    ]


def test_the_table_holds_the_papers_figures_and_ours_side_by_side() -> None:
    mine, theirs = FULL, "NMPC, IPOPT"
    text = render(cells_of(mine, 2) + cells_of(theirs, 0))
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert "lambda 0 0.01 0.03 0.05 0.07 0.1 0.15 0.2" in lines
    assert "paper: NMPC 0/5 1/5 4/5 5/5 5/5 5/5 5/5 5/5" in lines
    assert "paper: K-NMPC 0/5 0/5 1/5 0/5 1/5 1/5 3/5 1/5" in lines
    assert "paper: NMPC 8.30 8.10 8.98 - - - - -" in lines
    assert "paper: K-NMPC 7.30 7.30 7.23 7.05 6.94 6.70 6.55 6.85" in lines
    assert "paper: NMPC - 6.84 3.28 1.52 1.52 1.50 1.40 1.36" in lines
    assert "paper: K-NMPC - - 3.20 - 1.66 1.60 1.43 1.47" in lines
    assert mine + " 2/5" * 8 in lines and theirs + " 0/5" * 8 in lines
    assert lines.count("0.15 trained at 0.1: 2/5") == 1  # a nominal model learns nowhere
    assert mine + " 4" * 8 in lines  # millimetres of the deepest cut
    assert mine + " 6.54" * 8 in lines and mine + " 1.23" * 8 in lines
    assert lines[-1].endswith(f"K-NMPC: 7/40, {mine}: 16/40, {theirs}: 0/40")


def test_a_robot_that_lags_is_driven_over_a_map(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps, "LOG_EPISODES", 20)
    row = maps.drive(FULL, "lag, noisy, old", "moving", 0.1, 3)
    assert row.arrived and not row.collided and not row.peer
