"""The demo on a log of one's own: map, speeds and time limit are those of its robot."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.cli.own_course import OwnCourse, course_for
from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lab.sim.plants.plant import LearnedPlant
from kmpc_lab.studies.any_robot import Robot, record
from kmpc_lite.learn.learning import Learned, learn
from kmpc_lite.scenario.files import Scenario

LOG = Path("robot.csv")


def learned_course(data: kl.Dataset) -> tuple[Learned, OwnCourse]:
    learned = learn(data, [LOG])
    return learned, course_for(learned, data, Scenario.load("four_circles_1"))


def turned_while_driving(radius: float, speed: float) -> kl.Dataset:
    """The log of a car that drives circles to both sides, ahead and back."""
    random = np.random.default_rng(4)
    speeds = np.repeat(random.uniform(-speed, speed, 120), 5)
    curvatures = np.repeat(random.uniform(-1.0, 1.0, 120), 5) / radius
    inputs = np.column_stack([speeds, speeds * curvatures])
    states = kl.nominal_unicycle(0.1).rollout(np.zeros(3), inputs)
    states[1:] += random.normal(size=(len(inputs), 3)) * (0.01, 0.01, 0.003)
    return kl.Dataset([kl.Episode(states, inputs, 0.1)])


ROBOTS = [
    Robot("small and slow", 0.04, 0.1, 1.5, dt=0.05, slip=0.03, noise=(0.002, 0.01)),
    Robot("fast", 0.5, 4.0, 2.0, slip=0.05, lag=0.2, noise=(0.02, 0.01)),
    Robot("turns little", 0.2, 0.5, 0.08, slip=0.03, noise=(0.01, 0.01)),
    Robot("forward only", 0.2, 0.5, 0.8, slip=0.03, noise=(0.01, 0.01), reverse=False),
]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_robots_of_any_speed_arrive(robot: Robot) -> None:
    learned, course = learned_course(record(robot, 3))
    assert (course.problem.u_min[0] == 0.0) == (not robot.reverse)
    assert course.problem.u_max[0] == pytest.approx(robot.speed, rel=0.05), "as fast as its log"
    controller = kl.Controller(learned.model, course.scenario.problem(course.problem))
    plant = LearnedPlant(learned.model, 0)
    run = drive(controller, course.scenario, plant, learned.model.dt)
    assert run.outcome is Outcome.REACHED


def test_a_log_that_never_turns_on_the_spot_is_driven_as_a_car() -> None:
    learned, course = learned_course(turned_while_driving(1.2, 2.0))
    car = course.problem.wheels
    assert isinstance(car, kl.Car) and car.turning_radius == pytest.approx(1.2, rel=0.15)
    assert "as a car" in course.text
    controller = kl.Controller(learned.model, course.scenario.problem(course.problem))
    plant = LearnedPlant(learned.model, 0)
    run = drive(controller, course.scenario, plant, learned.model.dt)
    assert run.outcome is Outcome.REACHED
    curved = np.abs(run.inputs[:, 1]) <= np.abs(run.inputs[:, 0]) / car.turning_radius + 1e-6
    assert curved.all()
