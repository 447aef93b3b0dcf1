"""Cars and omnis that it was not tuned for: drawn, recognised in their logs, and driven."""

from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab.sim.plants.steered import Follower, OmniPlant, Rollers
from kmpc_lab.studies.any_wheels import STEERING, draw_car, draw_omni
from kmpc_lite.control.wheels import Car

AT_ONCE = Follower(0.0, (np.inf, np.inf), (0.0, 0.0))


def test_motors_answer_after_their_dead_time_and_no_faster_than_their_rate() -> None:
    follower = Follower(0.2, (0.5, 0.5, 0.5), (0.0, 0.0, 0.0))
    plant, pose, speeds = OmniPlant(Rollers(follower), 0.1, 0), np.zeros(3), []
    for _ in range(6):
        poses = plant.drive(pose, np.array((0.0, 1.0, 0.0)))
        speeds.append((poses[-1, 1] - pose[1]) / 0.1)
        pose = poses[-1]
    assert speeds[:2] == [0.0, 0.0]
    assert np.diff(speeds[2:]) == pytest.approx(0.05)


@pytest.mark.parametrize("column", STEERING)
def test_a_car_is_recognised_however_its_log_reports_the_steering(column: str) -> None:
    drawn = draw_car(31000)
    obeys = replace(drawn.chassis, follower=replace(AT_ONCE, rates=(np.inf, 9.0)), understeer=0.0)
    robot = replace(drawn, column=column, noise=(0.0, 0.0), chassis=obeys)
    ready = robot.ready(1)
    assert isinstance(ready.problem.wheels, Car)
    told = robot.chassis.wheelbase / np.tan(robot.chassis.lock)
    assert ready.problem.wheels.turning_radius == pytest.approx(told, rel=0.2)


def test_draws_are_of_all_sizes_and_the_same_again() -> None:
    cars, omnis = ([draw(seed) for seed in range(60)] for draw in (draw_car, draw_omni))
    assert cars[7] == draw_car(7) and omnis[7] == draw_omni(7)
    assert {car.column for car in cars} == set(STEERING)
    sizes = [car.radius for car in cars]
    assert min(sizes) < 0.1 and max(sizes) > 1.0
    assert {omni.footprint is None for omni in omnis} == {True, False}
