"""The section [lidar] of a scenario file."""

import pytest

from kmpc_lite.cli.main import main
from kmpc_lite.errors import ScenarioError
from kmpc_lite.reading import parse_toml
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.values import LidarSpec

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
