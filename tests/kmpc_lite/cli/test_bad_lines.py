"""One line with status 2 for whatever is wrong on a command line, and nothing is left behind."""

from pathlib import Path

import pytest
from command_folder import files

from kmpc_lite.cli import main as cli

BAD_LINES = [
    "",
    "fly",
    "fit",
    "fit {made}/drive.csv",
    "fit {made}/none.csv -o robot.npz",
    "fit {made}/drive.txt -o robot.npz",
    "fit {made}/brief.csv -o robot.npz",
    "fit {made}/drive.csv -o no/folder/robot.npz",
    "fit {made}/drive.csv -o {made}/drive.csv",
    "fit {made}/drive.csv -o robot.npz --seed -1",
    "fit {made}/drive.csv -o robot.npz --holdout 0",
    "fit {made}/drive.csv -o robot.npz --dt 1e9",
    "fit {made}/drive.csv -o robot.npz --gap -1",
    "fit {made}/drive.csv -o robot.npz --lags -1",
    "fit {made}/drive.csv -o robot.npz --product",
    "fit {made}/drive.csv -o robot.npz --method edmdc --dictionary trig",
    "simulate --scenario nowhere",
    "simulate --model {made}/none.npz",
    "simulate --model {made}/drive.csv",
    "simulate --slip -0.1",
    "simulate --margin -0.1",
    "simulate --plant moon",
    "simulate --plant learned --slip 0.1",
    "simulate --scenario {made}/short.toml --model {made}/robot.npz -o {made}/robot.npz",
    "report",
    "report {made}/robot.npz",
    "report {made}/run.npz -o {made}/run.npz",
    "study table2",
    "study maps --maps 0",
    "study maps --controllers nobody",
    "study table1 --resume",
    "study pedestrians --only told moon",
    "study real {made}/drive.csv --radius 0.15 --speed 0.6 --turn-rate 1 --models moon",
    "study maps --records {made}/drive.csv",
    "study faults --cluster nowhere",
    "demo --log {made}/robot.npz",
    "demo -o {made}/drive.csv",
    "bench --only nobody",
]


@pytest.mark.parametrize("line", BAD_LINES)
def test_bad_input_is_reported_in_one_line_and_nothing_is_left_behind(
    line: str, made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = {f: (made / f).read_bytes() for f in files(made)}
    try:
        status = cli.main([word.format(made=made) for word in line.split()])
    except SystemExit as ended:
        status = ended.code  # type: ignore[assignment]
    _, err = capsys.readouterr()
    assert status == 2
    assert err.startswith("kmpc") and len(err.splitlines()) == 1 and len(err) > 20
    assert files(here) == []
    assert {f: (made / f).read_bytes() for f in files(made)} == before
