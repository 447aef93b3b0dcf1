"""Robots that nobody has tuned it for arrive, and the study would see it if they did not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import (
    KNOWN,
    STANDARD,
    Robot,
    RobotPlant,
    random_footprint,
    random_robot,
    record,
    scaled,
)
from kmpc_lab.studies.robot_drives import course_of, drive, judge


@pytest.mark.parametrize("robot", KNOWN[:3], ids=lambda r: r.name)
def test_a_husky_a_warthog_and_a_toy_arrive_without_touching(robot: object) -> None:
    row = drive(robot, 3001)  # type: ignore[arg-type]
    assert row.in_pose and not row.collided and row.clearance > 0.0


def test_a_scaled_robot_takes_as_long() -> None:
    one, ten = (drive(scaled(STANDARD, by), 3002) for by in (1.0, 10.0))
    assert one.in_pose and ten.in_pose and ten.seconds == pytest.approx(one.seconds, abs=0.5)


def test_the_plant_moves_as_it_says() -> None:
    robot = replace(random_robot(5), lag=0.0, dead_time=0.2, slip=0.0, dt=0.1)
    plant = RobotPlant(robot, 0)
    command = np.array((robot.speed, 0.0))
    first, second = plant.drive(np.zeros(3), command), plant.drive(np.zeros(3), command)
    assert not first.any() and not second.any()  # the dead time
    third = plant.drive(np.zeros(3), command)
    assert third[-1, 0] == pytest.approx(0.1 * robot.speed)


def test_a_robot_is_learned_from_its_own_log() -> None:
    robot = replace(random_robot(7), seconds=40.0)
    log = record(robot, 1)
    assert log.dt == robot.dt
    model = kl.fit(log.windows(10.0))
    along = model.predict(np.zeros(3), (robot.speed, 0.0))[0]
    assert along == pytest.approx(robot.speed * robot.dt * (1.0 + robot.slip), rel=0.5)


def test_one_in_three_is_not_round_and_all_else_is_drawn_alike() -> None:
    robots = [random_robot(seed) for seed in range(300)]
    shaped = [robot for robot in robots if robot.footprint is not None]
    assert 70 < len(shaped) < 130
    assert [random_robot(seed, shapes=False) for seed in range(300)] == [
        replace(robot, footprint=None) for robot in robots
    ]
    for robot in shaped:
        assert robot.footprint is not None
        assert robot.footprint.radius <= 1.5 * robot.radius * (1.0 + 1e-9)
        assert robot.footprint.inner_radius < robot.radius
        assert robot.problem(4.0).footprint == robot.footprint
    larger = scaled(shaped[0], 2.0).footprint
    assert larger is not None and larger.radius == pytest.approx(2.0 * robots_radius(shaped[0]))


def robots_radius(robot: Robot) -> float:
    assert robot.footprint is not None
    return robot.footprint.radius


def test_a_robot_that_is_not_round_is_judged_by_its_outline() -> None:
    footprint = next(f for f in (random_footprint(s, 0.15) for s in range(99)) if f is not None)
    robot = replace(STANDARD, footprint=footprint)
    row = drive(robot, 3004)
    assert row.in_pose and not row.collided
    course = course_of(robot, 3004)
    corner = max(
        footprint.at(course.start).tolist(), key=lambda p: np.hypot(*(p - course.start[:2]))
    )
    in_it = [kl.Circle(*corner, 0.02)]
    controller = kl.Controller(kl.nominal_unicycle(0.1), robot.problem(course.side))
    touched = judge("x", 1, controller, RobotPlant(robot, 1), replace(course, circles=in_it))
    assert touched.collided
