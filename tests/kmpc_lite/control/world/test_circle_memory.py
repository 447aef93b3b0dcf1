"""Circles out of `sensor_range` are remembered by a robot that turns back from them."""

import copy
import math
import pickle

import numpy as np

import kmpc_lite as kl
from kmpc_lab.peers.ipopt import AREA
from kmpc_lab.sim.maps import random_map
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.drive import drive_past
from kmpc_lite.types import Array

REACH = 0.5
PROBLEM = kl.NavigationProblem(sensor_range=REACH)
START, GOAL = (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)
NOTHING = np.empty((0, 5))


def controller(problem: kl.NavigationProblem = PROBLEM) -> kl.Controller:
    return kl.Controller(kl.nominal_unicycle(0.1), problem)


def test_a_robot_between_two_paths_does_not_go_to_and_fro() -> None:
    scenario = random_map("open", 907)  # a circle beside each makes the other one quicker
    area = {**AREA, "du_max": (1.5, 5.0), "u_min": (-0.6, -0.785), "u_max": (0.6, 0.785)}
    ends = np.array(scenario.start), np.array(scenario.goal)

    def seconds(reach: float | None) -> float:
        far, plant = (reach or math.inf) + 0.15, DifferentialDrive(seed=907)
        robot = controller(kl.NavigationProblem(**area, sensor_range=reach))

        def seen(pose: Array) -> list[kl.Circle]:
            return [c for c in scenario.circles if math.dist(c[:2], pose[:2]) - c.radius <= far]

        move = lambda pose, command: plant.trace(pose, command, 0.1, 4)  # noqa: E731
        row = drive_past(robot, move, ends, scenario.circles, (1.0, 60.0), seen)
        assert row.arrived and not row.collided
        return row.seconds

    assert seconds(1.0) < 2.0 * seconds(None)


def test_the_memory_copies_and_pickles_with_the_state() -> None:
    scenario = random_map("open", 907)
    robot, x = controller(kl.NavigationProblem(sensor_range=0.3)), np.array(scenario.start)
    circles = np.array([(c.x, c.y, c.radius) for c in scenario.circles])
    remembered = 0
    for k in range(40):
        gaps = np.hypot(*(circles[:, :2] - x[:2]).T) - circles[:, 2] - 0.15
        if k % 10 == 9:
            before, state = robot.state, copy.deepcopy(robot.state)
            twin = pickle.loads(pickle.dumps(robot))
            plan = twin.step(x, scenario.goal, circles[gaps <= 0.3])
            robot.state = state
            first = robot.step(x, scenario.goal, circles[gaps <= 0.3])
            robot.state = before
            np.testing.assert_array_equal(plan.inputs, first.inputs)
        plan = robot.step(x, scenario.goal, circles[gaps <= 0.3])
        if k % 10 == 9:
            np.testing.assert_array_equal(plan.inputs, first.inputs)
        remembered = max(remembered, np.count_nonzero(robot.state.circles.unseen))
        x = robot.model.predict(x, plan.command)
    assert remembered
