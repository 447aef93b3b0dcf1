"""Sixty wrong logs: one line, exit status 2, and nothing is written."""

from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows
from valid_logs import WRONG

from kmpc_lite.cli import main as cli

HEADER = "t,x,y,theta,v,omega"
QUICK = ("ns", "theta deg", "mirrored", "swapped", "unrelated", "theta frozen")
DRIVES = {
    "commanded": {"seed": 3, "delay": 0.15, "lag": 0.1, "noise": (0.003, 0.003)},
    "fast": {"seed": 8, "speeds": (3.0, 1.5), "rate": 50.0, "gains": (0.9, 0.37)},
}
CASES = [
    pytest.param(wrong, kind, marks=[] if wrong in QUICK else pytest.mark.long)
    for wrong in WRONG
    for kind in DRIVES
]


@pytest.mark.parametrize(("wrong", "kind"), CASES)
def test_a_wrong_log_is_one_line_and_nothing_written(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: str, kind: str
) -> None:
    table = rows(drive(90.0, **{"rate": 20.0, **DRIVES[kind]}))
    log, model = tmp_path / "run.csv", tmp_path / "model.npz"
    np.savetxt(log, WRONG[wrong][0](table), delimiter=",", header=HEADER, comments="", fmt="%.12g")
    assert cli.main(["fit", str(log), "-o", str(model)]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1 and "run.csv: " in told.err
    assert sorted(path.name for path in tmp_path.iterdir()) == ["run.csv"]
