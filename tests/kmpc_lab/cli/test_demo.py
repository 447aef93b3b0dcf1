"""`kmpc demo` on a simulated robot, and through a link."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_folder import NEEDS_PICTURES, files

import kmpc_lite as kl
from kmpc_lab import load_drive
from kmpc_lab.studies.any_robot import Robot, record
from kmpc_lite.cli import main as cli
from kmpc_lite.scenario.files import Scenario


@NEEDS_PICTURES
def test_demo_does_the_main_job(here: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["demo", "--robot", "simulated", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "reached" and told["clearance_m"] > 0
    assert set(files(here)) == {
        "out",
        "out/drive.csv",
        "out/report.html",
        "out/robot.npz",
        "out/run",
        "out/run/drive.mcap",
    }
    assert told["held_out"]["multi_step"][0] < told["held_out"]["nominal_multi_step"][0]
    # what it wrote is what the other commands take
    assert len(kl.Dataset.load("out/drive.csv")) == 20
    assert load_drive("out/run").scenario.name == "four_circles_1"
    assert cli.main(["report", "out/run", "-o", "again.html"]) == 0
    assert 'id="drive"' in Path("again.html").read_text(), "it plays"
    assert kl.KoopmanModel.load("out/robot.npz").info["log"] == ["out/drive.csv"]
    # it learns as kmpc fit does
    assert cli.main(["fit", "out/drive.csv", "-o", "fitted.npz"]) == 0
    assert Path("out/robot.npz").read_bytes() == Path("fitted.npz").read_bytes()


@pytest.mark.long
def test_the_whole_demo_reaches_its_goal(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert cli.main(["demo", "--output", str(tmp_path / "out"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["outcome"] == "reached"
    assert load_drive(tmp_path / "out" / "run").clearance > 0.03


@pytest.fixture
def no_pages(here: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("kmpc_lab.report.html.write_report", lambda page, run, **more: None)


def driven(data: kl.Dataset, capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    data.save("run.csv")
    assert cli.main(["demo", "--log", "run.csv", "--json"]) == 0
    told: dict[str, Any] = json.loads(capsys.readouterr().out)
    assert told["outcome"] == "reached" and told["plant"] == "learned"
    return told


def turned_while_driving(radius: float, speed: float) -> kl.Dataset:
    """The log of a car that drives circles to both sides, ahead and back."""
    random = np.random.default_rng(4)
    speeds = np.repeat(random.uniform(-speed, speed, 120), 5)
    curvatures = np.repeat(random.uniform(-1.0, 1.0, 120), 5) / radius
    inputs = np.column_stack([speeds, speeds * curvatures])
    states = kl.nominal_unicycle(0.1).rollout(np.zeros(3), inputs)
    states[1:] += random.normal(size=(len(inputs), 3)) * (0.01, 0.01, 0.003)
    return kl.Dataset([kl.Episode(states, inputs, 0.1)])


ROBOTS = [
    Robot("small and slow", 0.04, 0.1, 1.5, dt=0.05, slip=0.03, noise=(0.002, 0.01)),
    Robot("fast", 0.5, 4.0, 2.0, slip=0.05, lag=0.2, noise=(0.02, 0.01)),
    Robot("turns little", 0.2, 0.5, 0.08, slip=0.03, noise=(0.01, 0.01)),
    Robot("forward only", 0.2, 0.5, 0.8, slip=0.03, noise=(0.01, 0.01), reverse=False),
]


@pytest.mark.usefixtures("no_pages")
@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_robots_of_any_speed_arrive(robot: Robot, capsys: pytest.CaptureFixture[str]) -> None:
    told = driven(record(robot, 3), capsys)
    assert (told["u_min"][0] == 0.0) == (not robot.reverse)
    assert told["u_max"][0] == pytest.approx(robot.speed, rel=0.05), "as fast as its log"
    assert Scenario.load("out/map.toml").radius > 0.2 * robot.speed


@pytest.mark.usefixtures("no_pages")
def test_without_turns_on_the_spot_it_is_a_car(capsys: pytest.CaptureFixture[str]) -> None:
    driven(turned_while_driving(1.2, 2.0), capsys)
    car = Scenario.load("out/map.toml").wheels
    assert isinstance(car, kl.Car) and car.turning_radius == pytest.approx(1.2, rel=0.15)
    v, omega = np.abs(load_drive("out/run").inputs).T
    assert (omega <= v / car.turning_radius + 1e-6).all()
