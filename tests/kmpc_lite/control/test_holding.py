"""A robot is said to hold only where it will come to rest within its tolerances."""

import numpy as np
import pytest
from outcomes.steered import Bicycle, Steering

import kmpc_lite as kl

PERIOD = 0.1  # [s]


@pytest.mark.parametrize(("reverse", "most"), [(False, 0), (True, 2)])
def test_of_cars_that_lag_more_than_their_model_knows_few_leave_holding(
    reverse: bool, most: int
) -> None:
    leave = rest = 0
    for number in range(41, 47):
        random = np.random.default_rng([number, 77])
        turning, speed = random.uniform(0.3, 0.8), random.uniform(0.5, 1.2)
        bounds, wheels = np.array((speed, speed / turning)), kl.Car(turning, reverse=reverse)
        problem = kl.NavigationProblem(u_min=-bounds, u_max=bounds, robot_radius=0.2, wheels=wheels)
        controller = kl.Controller(kl.nominal_unicycle(PERIOD), problem, clock=lambda: 0.0)
        plant = Bicycle(Steering(1 / turning, rate=3 / turning, lag=0.3, slip=0.02), PERIOD, number)
        goal = np.append(random.uniform(-4, 4, 2) * 2 * turning, random.uniform(-np.pi, np.pi))
        pose, held = np.zeros(3), []
        for _ in range(250):
            plan = controller.step(pose, goal)
            held.append(plan.holding)
            pose = plant.drive(pose, plan.command)[-1]
        leave += bool((np.diff(np.array(held, dtype=int)) < 0).any())
        rest += held[-1]
    assert leave <= most and (rest >= 5 if reverse else rest == 0)
