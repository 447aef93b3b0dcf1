"""Goals of a command line and of route files: poses, degrees, and what cannot be meant."""

import argparse

import pytest

from kmpc_lite.cli.command import Parser
from kmpc_lite.cli.options import add_goal_options, goals_of
from kmpc_lite.errors import ScenarioError


def parsed(line: str) -> argparse.Namespace:
    parser = Parser()
    add_goal_options(parser.add_argument, "on an empty map")
    return parser.parse_args(line.split())


def test_a_route_file_is_the_same_as_its_goals(tmp_path) -> None:
    file = tmp_path / "route.csv"
    file.write_text("\ufeffx, y ,theta\n1,-2,90deg\n\n-.5,0,-3.1\n")
    assert goals_of(parsed(f"--route {file} --loop")) == goals_of(
        parsed("--goal 1 -2 90deg --goal -.5 0 -3.1")
    )


@pytest.mark.parametrize("theta", ["90", "-6.3", "1e8"])
def test_more_than_a_turn_without_a_suffix_is_doubted(theta: str) -> None:
    with pytest.raises(Exception, match=f"for degrees write {theta}deg"):
        parsed(f"--goal 0 0 {theta}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("1,2,3\n", "line 1: expected the columns x,y,theta"),
        ("x,y,theta\n", "expected at least one goal"),
        ("x,y,theta\n0,0,0\n1,2\n", "line 3: expected 3 values, got 2"),
        ("x,y,theta\n0,nan,0\n", "line 2: expected a number, got nan"),
    ],
)
def test_a_wrong_route_is_reported_with_its_line(tmp_path, text: str, words: str) -> None:
    file = tmp_path / "route.csv"
    file.write_text(text)
    with pytest.raises(ScenarioError, match=words):
        goals_of(parsed(f"--route {file}"))


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("--route no.csv", "no.csv: cannot read the route"),
        ("--goal 1 0 0 --loop", "expected at least 2 goals"),
    ],
)
def test_what_cannot_be_driven_is_refused(line: str, words: str) -> None:
    with pytest.raises(ScenarioError, match=words):
        goals_of(parsed(line))
