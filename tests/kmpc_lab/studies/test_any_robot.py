"""Robots that it was not tuned for arrive, and the study would see it if they did not."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import STANDARD, RobotPlant, random_footprint, random_robot
from kmpc_lab.studies.drive import drive_past
from kmpc_lab.studies.robot_drives import drive


def test_the_plant_moves_as_it_says() -> None:
    robot = replace(random_robot(5), lag=0.0, dead_time=0.2, slip=0.0, dt=0.1)
    plant = RobotPlant(robot, 0)
    command = np.array((robot.speed, 0.0))
    first, second = plant.drive(np.zeros(3), command), plant.drive(np.zeros(3), command)
    assert not first.any() and not second.any()  # the dead time
    third = plant.drive(np.zeros(3), command)
    assert third[-1, 0] == pytest.approx(0.1 * robot.speed)


def test_a_robot_that_is_not_round_is_judged_by_its_outline() -> None:
    footprint = next(f for f in (random_footprint(s, 0.15) for s in range(99)) if f is not None)
    robot = replace(STANDARD, footprint=footprint)
    row = drive(robot, 3004)
    assert row.arrived and not row.collided
    start, goal = np.zeros(3), np.array((1.0, 0.0, 0.0))
    corners = footprint.at(start)
    in_it = [kl.Circle(*corners[np.hypot(*corners.T).argmax()].tolist(), 0.02)]
    controller = kl.Controller(kl.nominal_unicycle(0.1), robot.problem(4.0))
    touched = drive_past(controller, RobotPlant(robot, 1).drive, (start, goal), in_it, (1.0, 5.0))
    assert touched.collided
