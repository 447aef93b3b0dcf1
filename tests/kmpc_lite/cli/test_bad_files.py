"""Whatever is wrong inside a log, a scenario or a model file.

Kmpc says it in one line, ends with status 2, and writes nothing.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.cli import main as cli

HEADER = ["t", "x", "y", "theta", "v", "omega"]
Rows = list[list[str]]


@pytest.fixture(scope="module")
def log() -> Rows:
    """A good log as text, header first."""
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(0.05, seed=1), episodes=1, steps=300, dt=0.1, seed=1
    )
    (drive,) = data.episodes
    numbers = np.column_stack(
        [0.1 * np.arange(301), drive.states, np.vstack([drive.inputs, drive.inputs[-1:]])]
    )
    return [HEADER, *([f"{v:.6f}" for v in row] for row in numbers)]


def put(row: int, column: str, value: str) -> Callable[[Rows], Rows]:
    """Change one value, counted as lines of the file are, from 1."""
    return lambda rows: [
        [value if (k, name) == (row, column) else v for name, v in zip(HEADER, line, strict=True)]
        for k, line in enumerate(rows, 1)
    ]


def constant(column: str, value: str) -> Callable[[Rows], Rows]:
    return lambda rows: (
        [rows[0]]
        + [
            [value if name == column else v for name, v in zip(HEADER, line, strict=True)]
            for line in rows[1:]
        ]
    )


BAD_LOGS: dict[str, tuple[Callable[[Rows], Rows], str]] = {
    "missing column": (lambda rows: [line[:-1] for line in rows], "line 1: header: omega missing"),
    "no number": (put(7, "v", "fast"), "line 7, column v: expected a number, got 'fast'"),
    "time runs back": (
        put(9, "t", "0.2"),
        "line 9, column t: time must grow, got 0.2 s after 0.6 s",
    ),
    "few rows": (lambda rows: rows[:9], "0.7 s of driving are too few"),
    "constant speed": (constant("v", "0.5"), "column v is constant (0.5)"),
    "never turns": (constant("omega", "0"), "column omega is constant (0)"),
    "frozen pose": (
        lambda rows: constant("theta", "1")(constant("x", "1")(constant("y", "1")(rows))),
        "does not excite the model",
    ),
}
GOOD_SCENARIO = """\
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.6, 0.6, 0.15]]
[robot]
radius = 0.15
start = [0.0, 0.0, 0.0]
goal = [1.5, 1.5, 0.0]
"""


def refused(
    words: list[str], told: str, here: Path, capsys: pytest.CaptureFixture[str], begun: str = ""
) -> None:
    """Status 2, one line on standard error with these words, and no file that was not there."""
    before = sorted(here.iterdir())
    assert cli.main(words) == 2
    out, err = capsys.readouterr()
    assert out == begun and err.startswith("kmpc: ") and err.count("\n") == 1
    assert told in err
    assert sorted(here.iterdir()) == before


SHOWS_LITTLE = ("constant speed", "never turns")


@pytest.mark.parametrize("name", BAD_LOGS)
def test_a_bad_log_is_refused(name: str, log: Rows, here: Path, capsys: pytest.CaptureFixture[str]):
    change, told = BAD_LOGS[name]
    (here / "run.csv").write_text("".join(",".join(line) + "\n" for line in change(log)))
    # where a free fit cannot be had, the default leaves the nominal robot, and warns
    free = ["--lags", "none"] if name in SHOWS_LITTLE else []
    refused(["fit", "run.csv", "-o", "robot.npz", *free], told, here, capsys)
    if name not in SHOWS_LITTLE:
        demo = ["demo", "--log", "run.csv", "-o", "out"]
        refused(demo, told, here, capsys, begun="1  kmpc fit run.csv -o out/robot.npz\n")


@pytest.mark.parametrize("name", SHOWS_LITTLE)
def test_a_log_that_shows_little_keeps_nominal_turns_and_warns(
    name: str, log: Rows, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    change, _ = BAD_LOGS[name]
    (here / "run.csv").write_text("".join(",".join(line) + "\n" for line in change(log)))
    assert cli.main(["fit", "run.csv", "-o", "robot.npz", "-v"]) == 0
    _, first, *more = capsys.readouterr().out.splitlines()
    assert "Missing: " in first and any(line.startswith("warn ") for line in more)
    assert any("heading: as commanded" in line for line in more)
    if name == "constant speed":  # its poses do not move on the mean
        assert "It stays nominal along (a gain of" in first
    else:
        assert cli.main(["demo", "--log", "run.csv"]) == 2
        assert "the log never turns" in capsys.readouterr().err


def test_a_bad_scenario_and_a_bad_model_are_refused(here: Path, capsys: pytest.CaptureFixture[str]):
    drive = ["simulate", "--record", "run", "--report", "run.html"]
    (here / "map.toml").write_text(GOOD_SCENARIO.replace("goal = [1.5, 1.5", "goal = [0.7, 0.7"))
    told = "[robot] goal: (0.7, 0.7) is 0.141421 m from the centre of circle 0"
    refused([*drive, "--scenario", "map.toml"], told, here, capsys)
    kl.nominal_unicycle(0.1).save(here / "robot.npz")
    whole = (here / "robot.npz").read_bytes()
    (here / "robot.npz").write_bytes(whole[: len(whole) // 2])
    told = "not a kmpc_lite model, or damaged"
    refused([*drive, "--model", "robot.npz"], told, here, capsys)
