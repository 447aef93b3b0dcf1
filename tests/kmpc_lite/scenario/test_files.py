"""Scenario files: what is wrong is named by file, section and key, and what is right survives being
written.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.cli.main import main
from kmpc_lite.control import Footprint
from kmpc_lite.errors import ScenarioError
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.bundled import bundled
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.values import KEYS, Floor, LidarSpec

GOOD = """\
[map]
bounds = [-2, -2.0, 2.0, 2.0]
circles = [[0.5, 0.5, 0.15], [1.0, -1.0, 0.2, 0.1, 0.0]]

[robot]
radius = 0.15
start = [0.0, 0.0, 0.0]
goal = [1.5, 1.5, 0.0]

[plant]
slip = 0.05

[run]
seed = 3
timeout = 12.5
"""


def write(folder: Path, text: str | bytes) -> Path:
    file = folder / "field.toml"
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def table(scenario: Scenario) -> dict[str, object]:
    return dict(vars(scenario))


def test_a_file_is_read_with_its_defaults(tmp_path: Path) -> None:
    scenario = Scenario.load(write(tmp_path, GOOD))
    assert scenario.name == "field"
    assert scenario.bounds == (-2.0, -2.0, 2.0, 2.0)
    assert scenario.circles == (kl.Circle(0.5, 0.5, 0.15), kl.Circle(1.0, -1.0, 0.2, 0.1, 0.0))
    assert (scenario.radius, scenario.start, scenario.goal) == (
        0.15,
        (0.0, 0.0, 0.0),
        (1.5, 1.5, 0.0),
    )
    assert (scenario.slip, scenario.turn_gain, scenario.pose_noise) == (0.05, 1.0, (0.0, 0.0, 0.0))
    assert (scenario.seed, scenario.timeout, scenario.margin) == (3, 12.5, 0.0)
    assert Scenario.load(str(tmp_path / "field.toml")).goal == scenario.goal


@pytest.mark.parametrize("name", bundled())
def test_bundled_scenarios_load_and_survive_being_written(name: str) -> None:
    scenario = Scenario.load(name)
    assert scenario.name == name
    again = Scenario.from_table(tomllib.loads(scenario.to_toml()), name, "text")
    assert table(again) == table(scenario)
    # a controller can be built for each, and the start is a place that a robot may stand at
    problem = scenario.problem()
    plan = kl.Controller(kl.nominal_unicycle(problem.dt), problem).step(
        scenario.start, scenario.goal, scenario.obstacles_at(0.0)
    )
    assert np.isfinite(plan.command).all()


def test_everything_survives_being_written(tmp_path: Path) -> None:
    scenario = Scenario(
        name="field",
        bounds=(-1.25, -2.0, 3.0, 1e3),
        circles=(kl.Circle(0.1 + 0.2, 1 / 3, 1e-9, -1e-3, 2.5), kl.Circle(1.0, 1.0, 0.0)),
        radius=0.123456789012345,
        start=(-1.0, -1.0, 3.1),
        goal=(2.5, 999.0, -12.7),
        slip=0.07,
        turn_gain=0.35,
        lag=0.3,
        dead_time=0.15,
        floors=(Floor(1.0, 0.2), Floor(2.5, 0.0, 0.6)),
        pose_noise=(0.01, 0.02, 0.003),
        pose_age=0.08,
        seed=12345678901234567890,
        timeout=7.5,
        tolerance=0.03,
        heading_tolerance=0.2,
        margin=0.11,
        du_max=(1.0, 4.5),
        turning_point=(-0.04, 1 / 3),
    )
    assert table(Scenario.load(write(tmp_path, scenario.to_toml()))) == table(scenario)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("radius = 0.15", "radius = 0.15\ndu_max = 1.0", "[robot] du_max: expected 2 numbers"),
        (
            "radius = 0.15",
            "radius = 0.15\ndu_max = [1.0, 0.0]",
            "[robot] du_max: expected numbers > 0",
        ),
        (
            "radius = 0.15",
            "radius = 0.15\nturning_point = [0.1]",
            "[robot] turning_point: expected 2 numbers",
        ),
        ("[0.5, 0.5, 0.15],", "[0.5, 0.5],", "[map] circles: circle 0"),
        (
            "circles = [[0.5, 0.5, 0.15], [1.0, -1.0, 0.2, 0.1, 0.0]]",
            "circles = 4",
            "[map] circles: expected a list",
        ),
        (
            "slip = 0.05",
            "floors = [[1.0, 0.2]]",
            "[plant] floors: expected a list of [time, slip, turn_gain]",
        ),
        ("slip = 0.05", "floors = [[1.0, -0.2, 1.0]]", "[plant] floors: floor 0"),
        (
            "slip = 0.05",
            "floors = [[2.0, 0.2, 1.0], [1.0, 0.2, 1.0]]",
            "[plant] floors: expected rising times",
        ),
        ("slip = 0.05", "pose_noise = [0.1, -0.1, 0]", "[plant] pose_noise"),
        ("[map]", "map = 3\n[chart]", "[map] must be a section"),
    ],
)
def test_every_wrong_key_is_named(tmp_path: Path, old: str, new: str, words: str) -> None:
    assert old in GOOD
    with pytest.raises(kl.ScenarioError) as caught:
        Scenario.load(write(tmp_path, GOOD.replace(old, new)))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)
    assert "field" in str(caught.value)


def test_a_missing_file_and_an_unknown_name_are_distinguished(tmp_path: Path) -> None:
    with pytest.raises(kl.ScenarioError, match="No such file"):
        Scenario.load(tmp_path / "none.toml")
    with pytest.raises(kl.ScenarioError, match=r"no scenario named 'moon'.*mehrez"):
        Scenario.load("moon")
    with pytest.raises(kl.ScenarioError, match="directory"):
        Scenario.load(tmp_path)


def test_a_scenario_made_in_code_is_checked_as_a_file_is() -> None:
    good = Scenario.load("mehrez")
    with pytest.raises(kl.ScenarioError, match="goal"):
        replace(good, goal=(3.0, 0.0, 0.0))
    with pytest.raises(kl.ScenarioError, match="start"):
        replace(good, radius=0.7)
    with pytest.raises(kl.ScenarioError, match="bounds"):
        replace(good, bounds=(1.0, 0.0, 0.0, 2.0))


def test_every_key_of_a_file_is_a_field() -> None:
    fields = set(vars(Scenario.load("mehrez")))
    others = {"name", "options", "lidar", "has_area"}
    assert {key for keys in KEYS.values() for key in keys} == fields - others


TUNED = """
[controller.guidance]
lead_time = 0.3

[controller.pose]
agreement = 0.5

[controller.solver.real_time]
max_iter = 80
adaptive_rho = true

[controller.moving_obstacles]
speed_scales = [0.5, 0.0]
"""


def test_the_controllers_options_are_read_and_written(tmp_path: Path) -> None:
    scenario = Scenario.load(write(tmp_path, GOOD + TUNED))
    changed = scenario.options.changed()
    assert changed == {
        "guidance": {"lead_time": 0.3},
        "solver": {"real_time": {"max_iter": 80, "adaptive_rho": True}},
        "moving_obstacles": {"speed_scales": (0.5, 0.0)},
        "pose": {"agreement": 0.5},
    }
    again = Scenario.from_table(tomllib.loads(scenario.to_toml()), "field", "text")
    assert again.options == scenario.options
    assert "[controller" not in Scenario.load(write(tmp_path, GOOD)).to_toml()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[controller.gidance]", "gidance: unknown; did you mean 'guidance'?"),
        ("[controller.guidance]\nled_time = 1", "guidance.led_time: unknown; did you mean 'lead_t"),
        ("[controller]\nguidance = 3", "guidance: expected a table, got 3"),
        ("[controller.guidance]\nlead_time = -1", "lead_time: expected a number >= 0 [s], got -1"),
        ("[controler.guidance]", "unknown section [controler]; did you mean 'controller'?"),
    ],
)
def test_a_wrong_option_is_reported_with_its_file(tmp_path: Path, text: str, words: str) -> None:
    file = write(tmp_path, f"{GOOD}\n{text}\n")
    with pytest.raises(kl.ScenarioError) as refused:
        Scenario.load(file)
    told = str(refused.value)
    assert told.startswith(str(file)) and words in told and "\n" not in told


def test_without_bounds_the_robot_may_go_everywhere_and_pictures_show_all() -> None:
    table = {
        "map": {"circles": [[5.0, 9.0, 0.5]], "walls": [[-7.0, 0.0, -6.0, 0.0, 0.1]]},
        "robot": {"start": [0, 0, 0], "goal": [8.0, 1.0, 0.0]},
    }
    scenario = Scenario.from_table(table, "open", "open.toml")
    assert np.isinf(scenario.problem().x_min).all() and np.isinf(scenario.problem().x_max).all()
    assert scenario.bounds == (-8.0, -2.0, 9.0, 10.0)
    again = Scenario.from_table(tomllib.loads(scenario.to_toml()), "open", "open.toml")
    assert vars(again) == vars(scenario)


def test_without_bounds_a_grid_is_the_area_however_it_is_turned() -> None:
    table = tomllib.loads(Scenario.load("room_grid").to_toml())
    del table["map"]["bounds"]
    scenario = Scenario.from_table(table, "room", "room.toml")
    grid = scenario.grid
    assert grid is not None and scenario.has_area
    height, width = grid.occupied.shape
    x, y, theta = grid.origin
    assert theta == 0.0
    far = (x + grid.resolution * width, y + grid.resolution * height)
    np.testing.assert_allclose(scenario.bounds, (x, y, *far))
    np.testing.assert_allclose(scenario.problem().x_max[:2], far)
    table["robot"]["goal"] = [far[0] + 0.1, 0.0, 0.0]
    with pytest.raises(kl.ScenarioError, match="goal: .* lies outside the bounds"):
        Scenario.from_table(table, "room", "room.toml")


def scenario(start: tuple[float, float, float], footprint: Any) -> Scenario:
    table = {
        "map": {"bounds": [-2, -2, 2, 2], "circles": [[0.0, 0.0, 0.2]]},
        "robot": {"footprint": footprint, "start": list(start), "goal": [1.5, 1.5, 0.0]},
    }
    return Scenario.from_table(table, "cart", "cart.toml")


def test_is_read_and_written() -> None:
    made = scenario((-1.0, 0.0, 0.0), {"length": 0.8, "width": 0.3, "ahead": -0.2})
    assert made.footprint == Footprint.rectangle(0.8, 0.3, -0.2)
    assert made.radius == made.footprint.radius
    assert made.problem().footprint == made.footprint
    again = Scenario.from_table(parse_toml(made.to_toml()), "cart", "again")
    assert again.footprint == made.footprint and again.radius == made.radius


def test_may_stand_where_its_circle_could_not() -> None:
    # 0.2 m beside the circle's edge, along it
    made = scenario((0.0, -0.4, 0.0), {"length": 0.8, "width": 0.3})
    assert made.radius > 0.4
    with pytest.raises(ScenarioError, match=r"cart: \[robot\] start: .* overlaps an obstacle by"):
        scenario((0.0, -0.4, 1.57), {"length": 0.8, "width": 0.3})


@pytest.mark.parametrize(
    ("footprint", "expected"),
    [
        ({"length": 0.8}, r"cart.toml: \[robot\] footprint: footprint: expected corners"),
        ([[0, 0], [1, 0]], "footprint: expected at least 3 corners"),
        ({"length": 1e9, "width": 1.0}, "footprint: expected at most 1e"),
    ],
)
def test_wrong_ones_are_reported(footprint: Any, expected: str) -> None:
    with pytest.raises(ScenarioError, match=expected):
        scenario((-1.0, 0.0, 0.0), footprint)


BASE = {"map": {"bounds": [-2, -2, 2, 2]}, "robot": {"start": [0, 0, 0], "goal": [1, 1, 0]}}


def read(lidar):
    return Scenario.from_table({**BASE, "lidar": lidar}, "x", "map.toml")


def test_what_is_left_out_is_usual_and_all_is_written_and_read_back():
    assert read({}).lidar == LidarSpec()
    told = {"reach": 8, "beams": 720, "noise": 0.03, "dropout": 0.1, "nearest": 0.15, "rate": 7.5}
    there = read({**told, "mount": [0.2, 0.0, 3.14]})
    assert there.lidar == LidarSpec(8.0, 720, 0.03, 0.1, 0.15, 7.5, (0.2, 0.0, 3.14))
    again = Scenario.from_table(parse_toml(there.to_toml()), "x", "map.toml")
    assert again.lidar == there.lidar


@pytest.mark.parametrize(
    ("lidar", "told"),
    [
        (3, "must be a section"),
        ({"reech": 2}, "did you mean"),
        ({"reach": 0}, "reach: expected a number > 0"),
        ({"reach": "far"}, "reach: expected a finite number"),
        ({"beams": 1.5}, "beams: expected a whole number"),
        ({"nearest": 9.0}, "nearest: expected less than the reach"),
        ({"mount": [1, 2]}, "mount: expected 3 numbers"),
    ],
)
def test_what_cannot_be_meant_is_reported(lidar, told):
    with pytest.raises(ScenarioError, match=told) as refused:
        read(lidar)
    assert "map.toml: [lidar]" in str(refused.value) and "\n" not in str(refused.value)


def test_the_option_is_the_section(tmp_path):
    file = tmp_path / "map.toml"
    file.write_text(read({"beams": 60}).to_toml())
    out = str(tmp_path / "run")
    words = ["--timeout", "0.2", "--record", out]
    assert main(["simulate", str(file), "--lidar", "2", *words]) == 1
    from kmpc_lab import load_drive

    assert load_drive(out).scenario.lidar == LidarSpec(2.0, 60)
    assert main(["simulate", str(file), *words]) == 1
    again = load_drive(out)
    assert again.scenario.lidar == LidarSpec(4.0, 60)
    assert again.details is not None and len(again.details.scans) == 2
