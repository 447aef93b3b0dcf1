"""`kmpc fit`: what it chooses if nothing is said, what it tells, what it refuses."""

import json
from pathlib import Path

import numpy as np
import pytest
from command_folder import files
from foreign_logs import drive, write_csv, write_dataflash, write_tum

import kmpc_lite as kl
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite.cli import main as cli
from kmpc_lite.cli.fit import read_lags

HEADER = "t,x,y,theta,v,omega"


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A log of two minutes of a robot that answers late."""
    file = tmp_path_factory.mktemp("late") / "late.csv"
    robot = LaggingDrive(0.25, 0.1, 0.05, seed=1)
    drive_log(robot, 12, 100, 0.1, 1, hold=10, pose_noise=(0.002, 0.002, 0.004)).save(file)
    return file


def test_by_default_a_late_robot_is_known_as_one(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "late.npz"
    assert cli.main(["fit", str(late), "-o", str(model)]) == 0
    robot, first, *more = capsys.readouterr().out.splitlines()
    assert robot.startswith("robot  differential; lag speed 0.10 s dead time + 0.25 s")
    assert first.startswith("Good: predicts ") and "times better than nominal" in first
    kinds = [line.split()[0] for line in more if not line.startswith("note")]
    assert kinds == ["errors", "margins:", "wrote"]
    assert kl.KoopmanModel.load(model).history > 4
    assert cli.main(["fit", str(late), "-o", str(model), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    ours, nominal = (facts["held_out"][k] for k in ("multi_step", "nominal_multi_step"))
    assert all(mine < 0.25 * theirs for mine, theirs in zip(ours, nominal, strict=True))
    assert facts["learned"]["lag"]["speed"]["time_constant"] == pytest.approx(0.25, abs=0.05)


@pytest.mark.parametrize(
    ("options", "history", "symmetric"),
    [
        (["--lags", "none"], 0, True),
        (["--lags", "0", "2"], 2, True),
        (["--no-symmetry"], 0, False),
        (["--dictionary", "unicycle", "--method", "edmdc"], 0, False),
        (["--dictionary", "hermite1", "--lags", "none"], 0, True),
    ],
)
def test_what_is_asked_for_is_fitted(
    late: Path, tmp_path: Path, options: list[str], history: int, symmetric: bool
) -> None:
    file = tmp_path / "model.npz"
    assert cli.main(["fit", str(late), "-o", str(file), *options]) == 0
    model = kl.KoopmanModel.load(file)
    assert model.history == history and model.info.get("symmetric", False) is symmetric
    assert "selection" not in model.info


def test_what_lags_may_be() -> None:
    assert read_lags(None, False) == "auto" == read_lags(["auto"], False)
    assert read_lags(None, True) is None and read_lags(["none"], False) is None
    assert read_lags(["0", "3"], True) == [0, 3]
    with pytest.raises(kl.DataError, match="--lags auto goes with the symmetric"):
        read_lags(["auto"], True)
    with pytest.raises(kl.DataError, match="--lags some: expected auto, none, or ages"):
        read_lags(["some"], False)


def test_a_suspect_log_is_refused_with_the_option_that_mends_it(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = np.genfromtxt(late, delimiter=",", skip_header=1)
    made, model = tmp_path / "run.csv", tmp_path / "model.npz"
    np.savetxt(made, table * [1e3, 1, 1, 1, 1, 1], delimiter=",", header=HEADER, comments="")
    assert cli.main(["fit", str(made), "-o", str(model)]) == 2
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "t is in ms; --units t=ms; --force learns" in told
    assert not model.exists()
    assert cli.main(["fit", str(made), "-o", str(model), "--units", "t=ms"]) == 0
    mended = kl.KoopmanModel.load(model)
    assert cli.main(["fit", str(late), "-o", str(model)]) == 0
    for name in ("speed", "turn"):
        found = (kl.KoopmanModel.load(model).info["response"][name], mended.info["response"][name])
        np.testing.assert_allclose(*found, atol=1e-9)


def test_what_is_forced_is_learned_and_reported(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = np.genfromtxt(late, delimiter=",", skip_header=1)
    made, model = tmp_path / "run.csv", tmp_path / "model.npz"
    np.savetxt(made, table * [1, 1, 1, 1, 1, -1], delimiter=",", header=HEADER, comments="")
    assert cli.main(["fit", str(made), "-o", str(model), "--force"]) == 0
    assert "suspect, and forced: omega > 0 lowers theta" in capsys.readouterr().out


def test_a_clock_that_runs_back_is_cut_if_forced(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = np.genfromtxt(late, delimiter=",", skip_header=1)
    table[500:, 0] -= 7.0
    made, model = tmp_path / "run.csv", tmp_path / "model.npz"
    np.savetxt(made, table, delimiter=",", header=HEADER, comments="")
    assert cli.main(["fit", str(made), "-o", str(model)]) == 2
    assert "line 502, column t: time must grow" in capsys.readouterr().err
    assert cli.main(["fit", str(made), "-o", str(model), "--force"]) == 0


def test_logs_of_several_kinds_are_learned_from_together(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    d = drive(60.0, rate=20.0, delay=0.2)
    logs = [write_csv(tmp_path / "a.csv", d), write_dataflash(tmp_path / "b.bin", d)]
    logs.append(write_tum(tmp_path / "c.tum", d))
    model = tmp_path / "model.npz"
    words = ["fit", *map(str, logs[:2]), "-o", str(model), "--json"]
    assert cli.main(words) == 0
    told = json.loads(capsys.readouterr().out)
    assert any("XKF1 (north, east, yaw)" in line for line in told["logs"])
    assert told["learned"]["lag"]["speed"]["dead_time"] == pytest.approx(0.2, abs=0.06)
    assert cli.main(["fit", str(logs[2]), "-o", str(model)]) == 2
    assert "--commands FILE" in capsys.readouterr().err
    beside = str(tmp_path / "c.commands.csv")
    assert cli.main(["fit", str(logs[2]), "-o", str(model), "--commands", beside]) == 0


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--columns", "theta"], "--columns: expected words such as theta=yaw, got 'theta'"),
        (["--units", "t=s", "t=ms"], "--units: t is given twice"),
        (["--frame", "utm"], "frame: expected enu, ned, swapped"),
        (["--topics", "odom=/odom"], "--topics: all of the logs are tables"),
        (["--shift", "nan"], "shift: expected a time in s"),
    ],
)
def test_options_that_cannot_be_understood(
    late: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], told: str
) -> None:
    model = tmp_path / "model.npz"
    assert cli.main(["fit", str(late), "-o", str(model), *words]) == 2
    assert told in capsys.readouterr().err and not model.exists()


def test_fit_writes_a_model_and_reports_how_good_it_is(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert (
        cli.main(["fit", str(made / "drive.csv"), "-o", "robot.npz", "-v", "--horizon", "1.5"]) == 0
    )
    out, err = capsys.readouterr()
    assert err == ""
    assert "nominal unicycle" in out and "1.5 s" in out and "robot.npz" in out
    model = kl.KoopmanModel.load("robot.npz")
    assert model.dt == 0.1
    assert model.info["held_out"]["horizon"] == pytest.approx(1.5)
    assert model.info["log"] == [str(made / "drive.csv")]
    assert files(here) == ["robot.npz"]


@pytest.mark.parametrize(
    ("output", "words"),
    [("no/folder/x.npz", "there is no folder no/folder"), (".", "it is a folder")],
)
def test_where_nothing_can_be_written_is_reported_before_logs_are_read(
    output: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["fit", "no_log.csv", "-o", output]) == 2
    assert f"{output}: cannot be written: {words}" in capsys.readouterr().err
