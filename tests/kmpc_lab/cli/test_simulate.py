"""`kmpc simulate`: it drives, keeps the run, and says why a robot did not arrive."""

import json
from pathlib import Path

import pytest
from command_folder import NEEDS_PICTURES, SHORT, files

import kmpc_lite as kl
from kmpc_lab import load_drive
from kmpc_lite.cli import main as cli


def test_simulate_drives_and_keeps_the_run(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = str(made / "short.toml")
    words = f"--model {made}/robot.npz --scenario {scenario} --seed 5 --margin 0.03 --record run"
    assert cli.main(["simulate", *words.split()]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("reached after") and "run/drive.mcap" in out and err == ""
    run = load_drive("run")
    assert run.outcome.value == "reached"
    assert (run.scenario.name, run.scenario.seed, run.scenario.margin) == ("short", 5, 0.03)
    assert files(here) == ["run", "run/drive.mcap"]


def test_simulate_drives_with_the_options_of_the_scenario(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "tuned.toml").write_text(f"{SHORT}[controller.guidance]\nlead_time = 0.3\n")
    assert cli.main(["simulate", "tuned.toml", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["options"] == {"guidance": {"lead_time": 0.3}}
    (here / "wrong.toml").write_text(f"{SHORT}[controller.guidance]\nlead_tim = 0.3\n")
    assert cli.main(["simulate", "wrong.toml"]) == 2
    assert "did you mean 'lead_time'?" in capsys.readouterr().err


@NEEDS_PICTURES
def test_a_drive_that_fails_for_its_lag_says_so(
    made: Path, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = SHORT.replace("timeout = 4.0", "timeout = 0.2")
    (here / "prompt.toml").write_text(late)
    (here / "late.toml").write_text(late + "[plant]\nlag = 0.3\n")
    history = kl.InputHistoryDictionary(kl.HermiteTrigDictionary(0), lags=(0, 1, 2))
    kl.fit(kl.Dataset.load(made / "drive.csv"), history).save(here / "history.npz")
    words = {
        (
            "prompt.toml",
            "history.npz",
            "slip",
        ): "looks back on 2 past commands, this robot obeys at once: --plant learned",
        (
            "late.toml",
            "robot.npz",
            "slip",
        ): "obeys late, its model knows no lag: learn it from a log of the robot with kmpc fit",
        ("late.toml", "history.npz", "slip"): "",
        ("prompt.toml", "history.npz", "learned"): "",
        ("prompt.toml", "robot.npz", "slip"): "",
    }
    for (scenario, model, plant), hint in words.items():
        file = here / model if model == "history.npz" else made / model
        assert (
            cli.main(["simulate", "--scenario", scenario, "--model", str(file), "--plant", plant])
            == 1
        )
        told = capsys.readouterr().out
        assert (
            told.startswith("timeout after 0.20 s")
            and ("hint" in told) == bool(hint)
            and hint in told
        )
