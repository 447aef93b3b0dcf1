"""A robot is said to hold only where it will come to rest within its tolerances."""

import math

import numpy as np
import pytest
from outcomes.steered import Bicycle, Steering

import kmpc_lite as kl

PERIOD, RADIUS = 0.1, 0.2


@pytest.mark.parametrize(("reverse", "number"), [(False, 3), (False, 7), (True, 7), (True, 9)])
def test_a_car_that_lags_more_than_its_model_knows_does_not_leave_holding(
    reverse: bool, number: int
) -> None:
    random = np.random.default_rng([number, 77])
    turning, speed = random.uniform(0.3, 0.8), random.uniform(0.5, 1.2)
    bounds = np.array((speed, speed / turning))
    wheels = kl.Car(turning, reverse=reverse)
    problem = kl.NavigationProblem(u_min=-bounds, u_max=bounds, robot_radius=RADIUS, wheels=wheels)
    controller = kl.Controller(kl.nominal_unicycle(PERIOD), problem, clock=lambda: 0.0)
    plant = Bicycle(Steering(1 / turning, rate=3 / turning, lag=0.3, slip=0.02), PERIOD, number)
    goal = np.array((*random.uniform(-4, 4, 2) * 2 * turning, random.uniform(-math.pi, math.pi)))
    pose, held = np.zeros(3), []
    for _ in range(250):
        plan = controller.step(pose, goal)
        held.append(plan.holding)
        pose = plant.drive(pose, plan.command)[-1]
    assert (np.diff(np.array(held, dtype=int)) >= 0).all()
    assert held[-1] == reverse
