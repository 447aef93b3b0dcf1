"""What a planner is asked, and what its path is: any planner drives the robot."""

import copy
import pickle

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.types import Array

MODEL, GOAL = kl.nominal_unicycle(0.1), (1.0, 0.6, 0.0)
STEPS = np.array([[0.0, 0.0, 0.0], [0.6, 0.0, 0.0], [0.6, 0.0, np.pi / 2], [0.6, 0.6, np.pi / 2]])


class Fixed:
    """Gives the same poses whatever it is asked, after some work."""

    def __init__(self, poses: Array, work: int = 0) -> None:
        self.poses, self.work, self.left, self.asked = poses, work, 0, list[kl.PathRequest]()

    def begin(self, request: kl.PathRequest) -> None:
        """Begin."""
        self.asked, self.left = [*self.asked, request], self.work

    def advance(self, quanta: int) -> int:
        """Work."""
        self.left -= quanta
        return quanta

    def path(self) -> kl.Path | str | None:
        """The poses."""
        return kl.Path(self.poses) if self.left <= 0 else None


def ending(*last: tuple[float, float, float]) -> Array:
    return np.concatenate([STEPS, np.array([STEPS[-1] * (1, 1, 0) + (0, 0, 0), *last])])


def drive(controller: kl.Controller, steps: int = 150) -> tuple[Array, bool]:
    pose, places = np.zeros(3), []
    for _ in range(steps):
        plan = controller.step(pose, GOAL)
        places.append(pose)
        if plan.holding:
            return np.array(places), True
        pose = MODEL.predict(pose, plan.command)
    return np.array(places), False


@pytest.mark.parametrize("radius", [0.15, 0.6])
def test_a_robot_drives_the_path_of_a_planner_of_its_users(radius: float) -> None:
    planner = Fixed(ending(GOAL))
    area = {"x_min": (-9.0, -9.0, -np.inf), "x_max": (9.0, 9.0, np.inf)}
    problem = kl.NavigationProblem(robot_radius=radius, **area)
    controller = kl.Controller(MODEL, problem, planner=planner)
    places, holds = drive(controller)
    assert holds
    corner = np.hypot(*(places[:, :2] - (0.6, 0.0)).T).min()
    assert corner < 0.1 * radius / 0.15
    # lengths in metres, whatever units the controller counts in
    request = planner.asked[0]
    assert request.inflation == pytest.approx(radius)
    np.testing.assert_allclose(request.target, GOAL)
    np.testing.assert_allclose(request.forward[0], 0.6)
    np.testing.assert_allclose(request.outline, [[0.0, 0.0, radius]])


def test_a_copy_searches_again_what_it_has_not_searched_itself() -> None:
    planner = Fixed(ending(GOAL), work=150)
    controller = kl.Controller(MODEL, planner=planner)
    pose = np.zeros(3)
    for _ in range(2):
        controller.step(pose, GOAL)
    twins = [copy.deepcopy(controller), pickle.loads(pickle.dumps(controller))]
    before = copy.deepcopy(controller.state)
    expected = [controller.step(pose, GOAL) for _ in range(3)]
    assert np.any(expected[-1].command)
    for twin in twins:
        for plan in expected:
            np.testing.assert_array_equal(twin.step(pose, GOAL).inputs, plan.inputs)
    controller.state = before
    for plan in expected:
        np.testing.assert_array_equal(controller.step(pose, GOAL).inputs, plan.inputs)
