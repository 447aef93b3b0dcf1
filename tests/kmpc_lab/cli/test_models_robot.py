"""A model file carries its robot: wheels, and the size that `fit` was told."""

import json
from pathlib import Path

import numpy as np
import pytest
from outcomes.steered import Bicycle, Mecanum, Rollers, Steering

import kmpc_lite as kl
from kmpc_lite.cli.main import main

DT = 0.05


def write_log(path: Path, kind: str) -> Path:
    """A log of two minutes of random commands."""
    random, pose, rows = np.random.default_rng(1), np.zeros(3), []
    car, omni = Bicycle(Steering(2.0, rate=4.0, lag=0.15), DT, 1), Mecanum(Rollers(lag=0.1), DT, 1)
    for k in range(2400):
        if k % 20 == 0:
            drawn = random.uniform(-1.0, 1.0, 3) * (0.6, 0.4, 1.0)
        told = (drawn[0], np.arctan(0.6 * drawn[2])) if kind == "car" else drawn
        rows.append((k * DT, *(pose + random.normal(size=3) * (0.002, 0.002, 0.004)), *told))
        steered = np.array((drawn[0], drawn[0] * 2.0 * drawn[2]))
        pose = (car.drive(pose, steered) if kind == "car" else omni.drive(pose, drawn))[-1]
    head = "t,x,y,theta,v,steering" if kind == "car" else "t,x,y,theta,vx,vy,omega"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


@pytest.mark.parametrize("kind", ["car", "omni"])
def test_a_models_robot_is_simulated_and_reported(kind: str, tmp_path: Path, capsys) -> None:
    log, file, report = (
        write_log(tmp_path / "log.csv", kind),
        tmp_path / "m.npz",
        tmp_path / "r.html",
    )
    assert main(["fit", str(log), "-o", str(file), "--radius", "0.25"]) == 0
    info = kl.KoopmanModel.load(file).info
    assert info["wheels"]["kind"] == kind and info["radius"] == 0.25
    if kind == "car":
        assert info["wheels"]["turning_radius"] == pytest.approx(0.5, rel=0.1)
    capsys.readouterr()
    drive = ["simulate", "--goal", "2", "1", "0", "--model", str(file)]
    assert main([*drive, "--report", str(report), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcome"] == "reached"
    told = report.read_text()
    assert "0.25" in told and "Noise at rest" in told
    # nobody knows how it drives faster than in its log
    assert main([*drive, "--max-speed", "3"]) == 2
    assert "shows 0." in capsys.readouterr().err
    assert main(["export", str(file), "-o", str(tmp_path / "c")]) == 2
    assert "export: wheels: the C code drives round robots" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("--radius", "0.2", "--footprint", "1", "1"), "follows from --footprint"),
        (("--footprint", "1"), "expected LENGTH WIDTH or LENGTH WIDTH AHEAD"),
    ],
)
def test_sizes_that_are_none_are_refused(words, told, tmp_path: Path, capsys) -> None:
    log = write_log(tmp_path / "log.csv", "car")
    assert main(["fit", str(log), "-o", str(tmp_path / "m.npz"), *words]) == 2
    assert told in capsys.readouterr().err
