"""Scenarios of a command line: by name, by file, or drawn from a goal and obstacles."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import pytest

from kmpc_lab.cli.scenario import add_scenario_options, read_scenario
from kmpc_lite.cli.main import main
from kmpc_lite.scenario.bundled import bundled, bundled_file
from kmpc_lite.scenario.files import Scenario


def read(line: str) -> Scenario:
    parser = argparse.ArgumentParser()
    add_scenario_options(parser)
    return read_scenario(parser.parse_args(line.split()))


def test_without_a_word_it_is_the_first_of_the_paper() -> None:
    assert vars(read("")) == vars(Scenario.load("four_circles_1"))


@pytest.mark.parametrize("line", ["mehrez", "--scenario mehrez"])
def test_a_name_is_that_scenario(line: str) -> None:
    assert vars(read(line)) == vars(Scenario.load("mehrez"))


def test_every_scenario_that_comes_along_has_a_file() -> None:
    assert len(bundled()) > 5 and all(bundled_file(name).exists() for name in bundled())


def test_a_goal_alone_is_an_empty_map_with_room_for_it() -> None:
    scenario = read("--goal 5 -1 1.5")
    assert (scenario.start, scenario.goal) == ((0.0, 0.0, 0.0), (5.0, -1.0, 1.5))
    assert scenario.bounds == (-2.0, -2.0, 6.0, 2.0) and scenario.circles == ()
    assert scenario.timeout > 25.0


def test_obstacles_stand_or_move() -> None:
    scenario = read("--start -3 0 0 --goal 1 0 0 --obstacle -1 0.1 0.2 --obstacle 0 4 0.3 0 -0.2")
    rows = [tuple(circle) for circle in scenario.circles]
    assert rows == [(-1.0, 0.1, 0.2, 0.0, 0.0), (0.0, 4.0, 0.3, 0.0, -0.2)]
    assert scenario.start == (-3.0, 0.0, 0.0) and scenario.bounds == (-4.0, -2.0, 2.0, 5.0)


def test_options_replace_and_add_to_what_the_scenario_has() -> None:
    own = Scenario.load("mehrez")
    scenario = read("mehrez --obstacle 0 -1 0.1 --goal 1 1 0 --slip 0.2 --seed 7 --timeout 33")
    assert len(scenario.circles) == len(own.circles) + 1 and scenario.goal == (1.0, 1.0, 0.0)
    assert (scenario.slip, scenario.seed, scenario.timeout) == (0.2, 7, 33.0)
    assert scenario.bounds == own.bounds and scenario.name == "mehrez"


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--obstacle 1 1 0.2", "give a --goal X Y THETA, or a scenario, too"),
        ("--start 1 1 0", "give a --goal X Y THETA, or a scenario, too"),
        ("--goal 1 1 0 --obstacle 1 2", "--obstacle 1 2: expected X Y R or X Y R VX VY"),
        ("--goal 1 1 0 --obstacle 1 2 0.1 1", "expected X Y R or X Y R VX VY"),
        ("--goal 1 1 0 --obstacle 1 1 0.2", "goal: (1, 1) is 0 m from the centre of circle 0"),
        ("--goal 1 1 0 --obstacle 5 5 -0.2", "expected a radius >= 0 m, got -0.2"),
        ("--goal 1 nan 0", "goal: expected a finite number, got nan"),
        ("--goal inf 1 0", "expected a finite number"),
        ("mehrez --scenario mehrez", "the scenario is given already: mehrez"),
        ("--goal 1 0 0 --timeout 0", "[run] timeout: expected a number > 0"),
    ],
)
def test_what_cannot_be_driven_is_told_in_one_line(
    line: str, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", *line.split()]) == 2
    err = capsys.readouterr().err
    assert words in err and err.count("\n") == 1


def test_a_drawn_scenario_is_driven_and_can_be_read_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from kmpc_lab import Run

    monkeypatch.chdir(tmp_path)
    line = "simulate --goal 0.8 0.2 0 --obstacle 0.4 -0.4 0.1 -o run.npz"
    assert main(line.split()) == 0
    assert capsys.readouterr().out.startswith("reached after")
    assert Run.load("run.npz").scenario.goal == (0.8, 0.2, 0.0)


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
