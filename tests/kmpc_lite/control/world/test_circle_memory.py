"""Circles out of `sensor_range` are remembered by a robot that turns back from them."""

import copy
import math
import pickle

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.drive import drive_past
from kmpc_lite.control.kernels.clearance import SPREAD_RATE, things_of
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.world.tracking import Tracking
from kmpc_lite.control.world.tracks import TrackedCircles
from kmpc_lite.types import Array

REACH = 0.5
PROBLEM = kl.NavigationProblem(sensor_range=REACH)
START, GOAL = (-1.5, 0.0, 0.0), (1.5, 0.0, 0.0)
NOTHING = np.empty((0, 5))


def standing(*places: tuple[float, float]) -> Array:
    return np.array([[x, y, 0.2, 0.0, 0.0] for x, y in places])


def at_distance(gap: float) -> Array:
    """Pose whose edge is so far from the edge of a circle at the origin."""
    return np.array((-(gap + 0.2 + PROBLEM.robot_radius), 0.0, 0.0))


def recall(
    memory: Tracking,
    state: TrackedCircles,
    circles: Array,
    pose: Array,
    spread_rate: Array | float = 0.0,
    noise: float = 0.0,
    driven: float = 0.0,
) -> Array:
    things = things_of(circles, spread_rate)
    around = memory.see(state, things, (), pose, None, noise, driven)
    return around.things[:, :SPREAD_RATE]


@pytest.fixture
def memory() -> Tracking:
    return Tracking(PROBLEM, ControllerOptions())


@pytest.fixture
def state(memory: Tracking) -> TrackedCircles:
    """Of a robot to which a circle at the origin was given."""
    made = TrackedCircles()
    recall(memory, made, standing((0.0, 0.0)), at_distance(0.4))
    return made


@pytest.mark.parametrize(("gap", "remembered"), [(0.51, True), (0.48, False), (0.1, False)])
def test_circles_not_given_are_remembered_out_of_reach_and_forgotten_within(
    memory: Tracking, state: TrackedCircles, gap: float, remembered: bool
) -> None:
    assert len(recall(memory, state, NOTHING, at_distance(gap))) == remembered
    assert len(recall(memory, state, NOTHING, at_distance(2.0))) == remembered


def test_a_circle_given_again_is_not_there_twice_and_keeps_its_row(
    memory: Tracking, state: TrackedCircles
) -> None:
    here, other, far = at_distance(0.4), (0.0, 0.6), at_distance(2.0)
    for circles in (standing((0.0, 0.0), other), NOTHING, standing(other)):
        pose = here if len(circles) == 2 else far
        known = recall(memory, state, circles, pose)
        np.testing.assert_array_equal(known, standing((0.0, 0.0), other))
    known = recall(memory, state, standing(other, (0.005, 0.0)), here)
    np.testing.assert_array_equal(known, standing((0.005, 0.0), other))
    assert len(recall(memory, state, standing(other, (0.1, 0.0)), here)) == 2


def test_moving_circles_are_not_remembered(memory: Tracking, state: TrackedCircles) -> None:
    walks, far = standing((0.0, 0.0)) + (0.0, 0.0, 0.0, 0.3, 0.0), at_distance(2.0)
    np.testing.assert_array_equal(recall(memory, state, walks, far), walks)
    assert not len(recall(memory, state, NOTHING, far))
    # given as standing, and seen to move
    recall(memory, state, standing((0.0, 0.0)), far, np.array([0.1]))
    assert not len(recall(memory, state, NOTHING, far))


def test_the_latest_are_remembered_where_there_are_too_many() -> None:
    options = ControllerOptions.from_dict({"obstacles": {"circles": 3}})
    memory, state, far = Tracking(PROBLEM, options), TrackedCircles(), at_distance(9.0)
    for x in range(5):
        known = recall(memory, state, standing((float(x), 0.0)), far)
    np.testing.assert_array_equal(known[:, 0], (2.0, 3.0, 4.0))
    assert len(recall(memory, state, standing(*[(0.0, float(y)) for y in (1, 2, 3)]), far)) == 3


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
