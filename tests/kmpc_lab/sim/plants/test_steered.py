"""Simulated cars and omnis, by scenario files: what `kmpc simulate` drives."""

import pytest

import kmpc_lite as kl
from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lite.scenario.files import Scenario

ROBOT = """[map]
circles = [[0.5, 0.3, 0.3], [-0.3, 0.6, 0.25]]
bounds = [-2.0, -2.0, 2.0, 2.0]
[robot]
start = [-1.5, -1.0, 0.0]
goal = [1.5, 1.2, 1.0]
wheels = {wheels}
[plant]
slip = 0.03
"""


def scenario(tmp_path, wheels):
    file = tmp_path / "robot.toml"
    file.write_text(ROBOT.format(wheels=wheels))
    return Scenario.load(file)


@pytest.mark.parametrize(
    ("wheels", "expected"),
    [
        ('"omni"', kl.Omni()),
        ('{kind = "car", turning_radius = 0.8}', kl.Car(0.8)),
        ('{kind = "car", turning_radius = 0.8, steering_rate = 4.0}', kl.Car(0.8, 4.0)),
    ],
)
def test_a_scenario_names_its_wheels_and_is_driven(tmp_path, wheels, expected):
    found = scenario(tmp_path, wheels)
    assert found.wheels == expected
    (tmp_path / "again.toml").write_text(found.to_toml())
    assert Scenario.load(tmp_path / "again.toml").wheels == expected
    make = kl.nominal_omni if isinstance(expected, kl.Omni) else kl.nominal_unicycle
    problem = found.problem()
    run = drive(kl.Controller(make(0.1), problem), found, None, 0.1)
    assert run.outcome is Outcome.REACHED
    assert run.inputs.shape[1] == expected.inputs


@pytest.mark.parametrize("wheels", ['"hover"', '{kind = "car"}', '{kind = "car", radius = 1}', "3"])
def test_other_wheels_are_refused_with_their_place(tmp_path, wheels):
    with pytest.raises(kl.ScenarioError, match=r"\[robot\] wheels"):
        scenario(tmp_path, wheels)
