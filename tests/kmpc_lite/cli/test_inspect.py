"""`kmpc inspect`: what is in a log, in words, as JSON, and as a picture."""

import json
from pathlib import Path

import numpy as np
import pytest
from foreign_logs import drive, rows, write_bag, write_csv

from kmpc_lite.cli import main as cli

DRIVE = drive(60.0, rate=20.0, delay=0.3)


def test_a_robot_later_than_a_model_can_know_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for delay, late, much in ((1.1, True, False), (1.8, True, True)):
        made = write_csv(tmp_path / "late.csv", drive(40.0, rate=20.0, delay=delay))
        output = tmp_path / "late.npz"
        output.unlink(missing_ok=True)
        fit = ["fit", str(made), "-o", str(output)]
        for command, status in ((["inspect", str(made)], 0), (fit, 2 * much)):
            assert cli.main(command) == status
            told = "".join(capsys.readouterr())
            assert ("later than the 1 s that a model" in told) is late
            assert (f"--shift {delay:.1f}" in told) is late
        # what would drive into what it sees is not learned unless asked for
        assert output.exists() is not much
    assert "do not drive by it" in told
    assert cli.main([*fit, "--force"]) == 0 and output.exists()


def test_a_motion_before_its_command_is_reported(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = write_csv(tmp_path / "early.csv", drive(40.0, rate=20.0, delay=0.1))
    for shift, early in (("0.1", False), ("0.4", True)):
        assert cli.main(["inspect", str(made), "--shift", shift]) == 0
        told = capsys.readouterr().out
        assert ("precedes its command by 0.3" in told) is early
        assert ("nothing is suspect" in told) is not early
        assert ("--shift -0.3" in told) is early


def test_a_clock_that_steps_back_is_a_suspect_among_all_else(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = rows(DRIVE)
    table[600:, 0] -= 2.0
    made = tmp_path / "back.csv"
    np.savetxt(made, table, delimiter=",", header="t,x,y,theta,v,omega", comments="")
    assert cli.main(["inspect", str(made)]) == 1
    told = capsys.readouterr().out
    assert "suspect  line 602, column t: time must grow" in told and "1200 at 20 Hz" in told


def test_a_robot_that_does_not_turn_on_the_spot_is_suspect(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = rows(drive(120.0, rate=20.0, hold=2.0))
    asked = table[:, 4:] * (np.sin(0.5 * table[:, :1]) > 0.0) ** [1, 0]
    turned = np.where(np.abs(asked[:, 0]) > 0.05, asked[:, 1], 0.0) * 0.05
    theta = np.concatenate([[0.0], np.cumsum(turned)[:-1]])
    path = np.concatenate([[0.0], np.cumsum(0.05 * asked[:, 0] * np.exp(1j * theta))[:-1]])
    car = np.column_stack([table[:, 0], path.real, path.imag, theta, asked])
    made = tmp_path / "car.csv"
    np.savetxt(made, car, delimiter=",", header="t,x,y,theta,v,omega", comments="")
    assert cli.main(["inspect", str(made)]) == 1
    assert "suspect  this robot does not turn on the spot" in capsys.readouterr().out


def test_topics_and_rates_of_a_bag(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("rosbags")
    made = write_bag(tmp_path / "bag", DRIVE, "mcap")
    assert cli.main(["inspect", str(made), "--json"]) == 0
    (found,) = json.loads(capsys.readouterr().out)["logs"]
    rates = {t["name"]: t["rate"] for t in found["topics"]}
    assert rates["/odom"] == pytest.approx(20.0, rel=0.01)
    assert rates["/cmd_vel"] == pytest.approx(10.0, rel=0.01) and found["suspects"] == []


def test_what_is_suspect_is_reported_and_is_a_status(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made = write_csv(tmp_path / "run.csv", DRIVE, scale={"theta": 180 / np.pi, "t": 1e9})
    assert cli.main(["inspect", str(made)]) == 1
    told = capsys.readouterr().out
    assert "suspect  " in told and "--units theta=deg" in told and "--units t=ns" in told
    assert cli.main(["inspect", str(made), "--units", "theta=deg", "t=ns"]) == 0


@pytest.mark.parametrize("ending", ["svg", "png"])
def test_a_picture_of_path_and_commands(tmp_path: Path, ending: str) -> None:
    pytest.importorskip("matplotlib")
    made = write_csv(tmp_path / "run.csv", DRIVE)
    assert cli.main(["inspect", str(made), "--plot", str(tmp_path / f"run.{ending}")]) == 0
    head = (tmp_path / f"run.{ending}").read_bytes()[:100]
    assert b"<?xml" in head if ending == "svg" else head.startswith(b"\x89PNG")


def test_a_picture_never_takes_the_place_of_a_log(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("matplotlib")
    made = write_csv(tmp_path / "run.csv", DRIVE)
    before = made.read_bytes()
    assert cli.main(["inspect", str(made), "--plot", str(made)]) == 2
    assert cli.main(["inspect", str(made), "--plot", str(tmp_path / "run.doc")]) == 2
    assert cli.main(["inspect", str(tmp_path / "none.csv")]) == 2
    assert made.read_bytes() == before and [p.name for p in tmp_path.iterdir()] == ["run.csv"]
    assert capsys.readouterr().err.count("\n") == 3
