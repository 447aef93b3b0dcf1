"""``kmpc study limits``: robots with real accelerations, among circles, from slow to quick ones.

A row is a robot of a speed and two accelerations in a field of 15 to 25 circles, which are known,
or reported within a reach (0: all of them). The controller is given the accelerations with the
nominal model, has learned them from a log of two minutes, or is told of none. The ideal time is
that of the straight line from rest to rest, and of turns on the spot at its ends, with the same
accelerations.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np

from kmpc_lab.studies.any_robot import Robot, RobotPlant, learn
from kmpc_lab.studies.drive import DriveResult, drive_past
from kmpc_lab.studies.table import DRIVES, FEASIBLE, GAP, JERK, LOST, TIME, Column, mean_of
from kmpc_lite.control import Circle, Controller, NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.types import Array

ROBOTS = {
    f"{speed:g} m/s, {ramp:g} m/s^2, {turn:g} rad/s^2": (speed, ramp, turn)
    for speed, ramp, turn in (
        (0.3, 0.3, 1.0),
        (0.6, 0.4, 2.0),
        (1.0, 0.5, 1.5),
        (1.5, 1.5, 5.0),
        (1.5, 5.0, 10.0),
        (3.0, 1.0, 3.0),
        (4.0, 0.3, 1.0),
        (4.0, 5.0, 10.0),
    )
}
"""Speeds, accelerations and turn accelerations."""
FASTEST_TURN = 2.0  # [rad/s]
SIDE, RADIUS = (8.0, 24.0), (0.15, 0.3)
"""Of the field and of the robot [m], up to the next speed and beyond it."""
QUICK = 2.0  # speed from which on fields and robots are larger [m/s]
APART = 3.0  # least gap between circles [radii of the robot]: it can drive through all of them
SLIP = 0.05
COLUMNS = (*DRIVES, TIME, LOST, FEASIBLE, JERK, GAP, Column("fastest", ".2f", mean_of("fastest")))


def robot_of(name: str) -> Robot:
    """Robot of a row, with how long it takes from rest to its fastest commands."""
    speed, ramp, turn = ROBOTS[name]
    turn_rate = min(math.pi / 4 * speed / 0.6, FASTEST_TURN)
    times = speed / ramp, turn_rate / turn
    return Robot(
        name,
        RADIUS[speed >= QUICK],
        speed,
        turn_rate,
        ramps=(times[0], times[0]),
        turn_ramp=times[1],
        slip=SLIP,
        seconds=max(120.0, 20.0 * max(times)),
    )


@cache
def model_of(name: str, knows: str) -> KoopmanModel:
    """Model of a row's robot."""
    robot = robot_of(name)
    return learn(robot, 0) if knows == "learned" else nominal_unicycle(robot.dt)


def field(robot: Robot, side: float, seed: int) -> tuple[Array, Array, Array]:
    """Start (3,), goal (3,) and circles (M, 3) of a field."""
    random, half = np.random.default_rng([seed, 71]), 0.5 * side
    start, goal = (
        np.array((way * half, 0.6 * half * random.uniform(-1, 1), random.uniform(-3, 3)))
        for way in (-0.8, 0.8)
    )
    gap, circles = APART * robot.radius, np.empty((0, 3))
    for _ in range(200 * (count := int(random.integers(15, 26)))):
        if len(circles) == count:
            break
        x, y = 0.85 * half * random.uniform(-1, 1, 2)
        radius = random.uniform(robot.radius, 0.06 * side)
        others = np.vstack([circles, (*start[:2], 0.0), (*goal[:2], 0.0)])
        if (np.hypot(*(others[:, :2] - (x, y)).T) >= others[:, 2] + radius + gap).all():
            circles = np.vstack([circles, (x, y, radius)])
    return start, goal, circles


def problem_of(robot: Robot, side: float, knows: str, reach: float) -> NavigationProblem:
    """Problem of a row: its limits are given if they are not learned."""
    _, ramp, turn = ROBOTS[robot.name]
    half, free = 0.5 * side, knows != "given"
    return NavigationProblem(
        dt=robot.dt,
        u_min=(-robot.speed, -robot.turn_rate),
        u_max=(robot.speed, robot.turn_rate),
        x_min=(-half, -half, -np.inf),
        x_max=(half, half, np.inf),
        robot_radius=robot.radius,
        sensor_range=reach or None,
        du_max=(np.inf, np.inf) if free else (ramp, turn),
        deceleration=None if free else (ramp, turn),
    )


def ideal_seconds(name: str, start: Array, goal: Array) -> float:
    """Turn, straight line, turn, each from rest to rest as quickly as the robot can."""
    _, ramp, turn = ROBOTS[name]
    robot, away = robot_of(name), goal[:2] - start[:2]
    along = math.atan2(away[1], away[0])

    def time(far: float, fastest: float, change: float) -> float:
        ramped = fastest**2 / change
        return 2.0 * math.sqrt(far / change) if far < ramped else far / fastest + fastest / change

    turns = (
        [
            abs(math.remainder(a, math.tau))
            for a in (along + back - start[2], goal[2] - along - back)
        ]
        for back in (0.0, math.pi)
    )
    quickest = min(sum(time(angle, robot.turn_rate, turn) for angle in both) for both in turns)
    return time(math.hypot(*away), robot.speed, ramp) + quickest


def drive(name: str, knows: str, reach: float, seed: int) -> DriveResult:
    """Drive one field."""
    robot = robot_of(name)
    side = SIDE[robot.speed >= QUICK]
    start, goal, rows = field(robot, side, seed)
    problem = problem_of(robot, side, knows, reach)
    circles, ideal = [Circle(*row) for row in rows], ideal_seconds(name, start, goal)

    def seen(pose: Array) -> list[Circle]:
        gaps = np.hypot(*(rows[:, :2] - pose[:2]).T) - rows[:, 2] - robot.radius
        return [circles[k] for k in np.flatnonzero(gaps <= (reach or np.inf))]

    return drive_past(
        Controller(model_of(name, knows), problem),
        RobotPlant(robot, seed).drive,
        (start, goal),
        circles,
        (ideal, 5.0 * ideal + 20.0),
        seen,
    )
