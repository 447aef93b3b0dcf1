"""`kmpc fit`: what it chooses where nothing is said, what it tells, what it refuses."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import kmpc_lite as kl
from kmpc_lite.cli import main as cli
from kmpc_lite.cli.fit import read_lags
from kmpc_lite.sim.plants.lag import LaggingDrive, drive_log


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
    told = capsys.readouterr().out
    assert "lag    speed 0.0" in told and "inputs commands (" in told
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
        (["--lags", "0", "1", "--product"], 1, True),
        (["--no-symmetry"], 0, False),
        (["--dictionary", "unicycle", "--method", "edmdc"], 0, False),
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
    assert read_lags(None, False, False) == "auto"
    assert read_lags(None, True, False) is None and read_lags(None, False, True) is None
    assert read_lags(["auto"], False, False) == "auto" and read_lags(["none"], False, False) is None
    assert read_lags(["0", "3"], True, False) == [0, 3]
    for product, free in ((True, False), (False, True)):
        with pytest.raises(kl.DataError, match="--lags auto goes with the symmetric"):
            read_lags(["auto"], product, free)
    with pytest.raises(kl.DataError, match="--lags some: expected auto, none, or ages"):
        read_lags(["some"], False, False)
