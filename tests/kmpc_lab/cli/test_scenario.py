"""Scenarios of a command line: by name, by file, or drawn from a goal and obstacles."""

import json
from pathlib import Path

import pytest

from kmpc_lite.cli.main import main


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--obstacle 1 1 0.2", "give a --goal X Y THETA, or a scenario, too"),
        ("--goal 1 1 0 --obstacle 1 2", "--obstacle 1 2: expected X Y R or X Y R VX VY"),
        ("--goal 1 1 0 --obstacle 5 5 -0.2", "expected a radius >= 0 m, got -0.2"),
        ("mehrez --scenario mehrez", "the scenario is given already: mehrez"),
        ("--goal 1 0 0 --timeout 0", "[run] timeout: expected a number > 0"),
    ],
)
def test_what_cannot_be_driven_is_reported_in_one_line(
    line: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *line.split()]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1


def test_a_drawn_scenario_is_driven_and_can_be_read_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from kmpc_lab import load_drive

    monkeypatch.chdir(tmp_path)
    line = "simulate --goal 0.8 0.2 0 --obstacle 0.4 -0.4 0.1 --record run"
    assert main(line.split()) == 0
    assert capsys.readouterr().out.startswith("reached after")
    assert load_drive("run").scenario.goal == (0.8, 0.2, 0.0)


def test_a_route_is_driven_goal_by_goal_and_recorded_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from kmpc_lite.learn.formats.mcap import read_messages

    monkeypatch.chdir(tmp_path)
    line = "simulate --goal 0.5 0 0 --goal 0.5 0.4 90deg --goal 0 0 0 --json --record drive"
    assert main(line.split()) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "reached" and report["route"] == {"goal": 3, "of": 3, "held": 3}
    with (tmp_path / "drive" / "drive.mcap").open("rb") as file:
        steps = [m.content for m in read_messages(file) if m.topic == "/step"]
    legs = [tuple(json.loads(step)["leg"]) for step in steps]
    assert list(dict.fromkeys(legs)) == [(1, 3), (2, 3), (3, 3)]
    assert legs == sorted(legs)


def test_a_loop_goes_on_until_time_is_up(capsys: pytest.CaptureFixture[str]) -> None:
    line = "simulate --goal 0.4 0 0 --goal 0 0 0 --loop --timeout 6 --json"
    assert main(line.split()) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["route"]["held"] >= 2 and report["duration_s"] == pytest.approx(12.0)
