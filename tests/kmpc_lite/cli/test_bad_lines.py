"""One line with status 2 for whatever is wrong on a command line, and nothing is left behind."""

from __future__ import annotations

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
    "fit {made} -o robot.npz",
    "fit {made}/drive.txt -o robot.npz",
    "fit {made}/robot.npz -o other.npz",
    "fit {made}/short.toml -o robot.npz",
    "fit {made}/brief.csv -o robot.npz",
    "fit {made}/drive.csv {made}/brief.csv {made}/drive.csv -o robot.npz",
    "fit {made}/drive.csv -o no/folder/robot.npz",
    "fit {made}/drive.csv -o .",
    "fit {made}/drive.csv -o {made}/drive.csv",
    "fit {made}/drive.csv -o robot.npz --seed -1",
    "fit {made}/drive.csv -o robot.npz --seed one",
    "fit {made}/drive.csv -o robot.npz --holdout 0",
    "fit {made}/drive.csv -o robot.npz --holdout 1.5",
    "fit {made}/drive.csv -o robot.npz --holdout nan",
    "fit {made}/drive.csv -o robot.npz --holdout 1e-9",
    "fit {made}/drive.csv -o robot.npz --dt 0",
    "fit {made}/drive.csv -o robot.npz --dt nan",
    "fit {made}/drive.csv -o robot.npz --dt 1e9",
    "fit {made}/drive.csv -o robot.npz --dt 1e-9",
    "fit {made}/drive.csv -o robot.npz --gap -1",
    "fit {made}/drive.csv -o robot.npz --gap 0.01",
    "fit {made}/drive.csv -o robot.npz --horizon 0",
    "fit {made}/drive.csv -o robot.npz --horizon 1e9",
    "fit {made}/drive.csv -o robot.npz --lags 1 1",
    "fit {made}/drive.csv -o robot.npz --lags -1",
    "fit {made}/drive.csv -o robot.npz --product",
    "fit {made}/drive.csv -o robot.npz --method pinv",
    "fit {made}/drive.csv -o robot.npz --dictionary fourier",
    "fit {made}/drive.csv -o robot.npz --method edmdc --dictionary trig",
    "simulate --scenario nowhere",
    "simulate --scenario {made}/none.toml",
    "simulate --scenario {made}",
    "simulate --scenario {made}/run.npz",
    "simulate --model {made}/none.npz",
    "simulate --model {made}/run.npz",
    "simulate --model {made}/drive.csv",
    "simulate --seed -1",
    "simulate --slip -0.1",
    "simulate --slip nan",
    "simulate --margin -0.1",
    "simulate --margin inf",
    "simulate --horizon 0",
    "simulate --horizon 1e3",
    "simulate --iterations 0",
    "simulate --plant moon",
    "simulate --plant learned --slip 0.1",
    "simulate --scenario {made}/short.toml -o no/folder/run.npz",
    "simulate --scenario {made}/short.toml -o .",
    "simulate --scenario {made}/short.toml -o {made}/short.toml",
    "simulate --scenario {made}/short.toml --model {made}/robot.npz -o {made}/robot.npz",
    "report",
    "report {made}/none.npz",
    "report {made}/robot.npz",
    "report {made}/drive.csv",
    "report {made}/run.npz -o {made}/run.npz",
    "report {made}/run.npz -o run.html --model {made}/run.npz",
    "study",
    "study table2",
    "study table1 --trials 0",
    "study maps --maps 0",
    "study maps --controllers nobody",
    "study maps --families moon",
    "study table1 --workers 0",
    "study table1 --resume",
    "study limits --only moon",
    "study pedestrians --only told moon",
    "study real {made}/drive.csv --radius 0.15 --speed 0.6 --turn-rate 1 --models moon",
    "study maps --records {made}/drive.csv",
    "study faults --cluster nowhere",
    "study table1 --trials many",
    "study table1 --scenario nowhere",
    "demo --log {made}/none.csv",
    "demo --log {made}/robot.npz",
    "demo -o {made}/drive.csv",
    "bench --drives 0",
    "bench --only nobody",
    "bench --loop -5",
]


@pytest.mark.parametrize("line", BAD_LINES)
def test_bad_input_is_told_in_one_line_and_nothing_is_left_behind(
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
