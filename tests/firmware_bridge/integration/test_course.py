"""What `kmpc run` makes of a robot file, a map and a model: the controller within the limits."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from firmware_bridge.integration.course import base_problem, build_controller, course, load_model
from firmware_bridge.messages import STILL
from firmware_bridge.robot_file import load_robot

ROBOTS = Path(__file__).parents[3] / "docs" / "robots"


def test_a_learned_model_is_adapted_while_driving_and_the_nominal_one_is_not(tmp_path):
    from kmpc_lite.scenario.files import Scenario

    file = tmp_path / "robot.npz"
    kl.fit(kmpc_lab.generate_dataset(kmpc_lab.DifferentialDrive(0.05), episodes=10, steps=60)).save(
        file
    )
    link = {"driver": "roboclaw", "url": "pty:link"}

    def built(control):
        robot = load_robot(ROBOTS / "roboclaw.toml", {"link": link, "control": control})
        robot, model, _ = load_model(robot)
        return build_controller(robot, Scenario.load("mehrez"), model)

    assert built({"model": str(file)}).adaptation is not None
    assert built({"model": str(file), "adaptation": False}).adaptation is None
    assert built({}).adaptation is None


def test_the_controller_knows_the_ramps_of_the_gate():
    robot = load_robot(
        ROBOTS / "roboclaw.toml", {"link": {"driver": "roboclaw", "url": "pty:link"}}
    )
    limits, problem = robot.gate.limits, base_problem(robot, 0.1)
    ramps = limits.acceleration, limits.angular_acceleration
    np.testing.assert_array_equal(problem.du_max, ramps)
    # what one period's plan asks for, the gate drives within the period
    assert limits.slew(STILL, (wanted := (0.1 * ramps[0], 0.0, 0.0)), 0.1) == wanted


@pytest.mark.parametrize(
    ("name", "model", "given", "expected"),
    [
        ("mavlink", None, None, 0.2),
        ("mavlink", None, 0.0, 0.0),
        ("mavlink", None, 0.35, 0.35),
        ("mavlink", (0,), None, 0.2),
        ("mavlink", (0, 1), None, 0.0),
        ("roboclaw", None, None, 0.0),
        ("vesc", None, 0.1, 0.1),
    ],
)
def test_a_model_without_lags_gets_a_latency_that_suits_the_driver_and_the_user_is_reported(
    desk, name, model, given, expected
):
    control = {"scenario": "course.toml", "latency": given}
    if model is not None:
        data = kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(), episodes=6, steps=60, dt=0.1, seed=0
        )
        kl.fit(data, lags=model or None).save("robot.npz")
        control["model"] = "robot.npz"
    drive = course(
        load_robot(None, {"link": {"url": "pty:x", "driver": name}, "control": control}), 1.0, 10.0
    )
    assert drive.robot.control.latency == expected
    told = [note for note in drive.notes if "control.latency" in note]
    assert bool(told) == (given is None and expected > 0.0) and "\n" not in "".join(told)
