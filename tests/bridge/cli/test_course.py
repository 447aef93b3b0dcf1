"""What `kmpc run` makes of a robot file, a map and a model: the controller within the limits."""

from pathlib import Path

import numpy as np

import kmpc_lite as kl
from firmware_bridge.cli.course import base_problem, build_controller, load_model
from firmware_bridge.robot_file import load_robot

ROBOTS = Path(__file__).parents[3] / "docs" / "robots"


def test_a_learned_model_is_adapted_while_driving_and_the_nominal_one_is_not(tmp_path):
    from kmpc_lite.sim import Scenario

    file = tmp_path / "robot.npz"
    kl.fit(kl.generate_dataset(kl.DifferentialDrive(0.05), episodes=10, steps=60)).save(file)
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
    assert limits.slew((0.0, 0.0), (0.1 * ramps[0], 0.0), 0.1) == (0.1 * ramps[0], 0.0)
