"""Studies ``anyrobot`` and ``scales``: robots that nobody tuned for, over maps of their sizes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from kmpc_lab.sim.maps import random_map
from kmpc_lab.studies.any_robot import (
    KNOWN,
    ODD,
    SCALES,
    STANDARD,
    Robot,
    RobotPlant,
    learn,
    random_robot,
    scaled,
)
from kmpc_lab.studies.any_wheels import CarRobot, Moves, OmniRobot, draw_car, draw_omni
from kmpc_lab.studies.drive import DriveResult, drive_past
from kmpc_lab.studies.table import DRIVES, STOPPED, TIME, Column, count_of
from kmpc_lite.control import Circle, Controller
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scale import UNIT_RADIUS

COLUMNS = (*DRIVES, Column("held elsewhere", "d", count_of("held_elsewhere")), TIME, STOPPED)
ROBOTS = {r.name: r for r in (*(scaled(STANDARD, by) for by in SCALES), *KNOWN, *ODD)}


def drive_course(
    robot: Robot | CarRobot | OmniRobot,
    seed: int,
    ready: Callable[[float], tuple[Controller, Moves]],
    family: str = "open",
) -> DriveResult:
    """Drive over a random map of a robot's size, and judge by the true poses.

    `ready`: gives controller and plant for a square area of a side [m].
    """
    scenario, by = random_map(family, seed), robot.radius / UNIT_RADIUS
    unit = np.array((by, by, 1.0))
    start, goal = np.array(scenario.start) * unit, np.array(scenario.goal) * unit
    controller, plant = ready(by * (scenario.bounds[2] - scenario.bounds[0]))
    ideal, (place, turn) = robot.ideal(start, goal), robot.noise
    return drive_past(
        controller,
        plant.drive,
        (start, goal),
        [Circle(by * c.x, by * c.y, by * c.radius, 0.0, 0.0) for c in scenario.circles],
        (ideal, 8.0 * ideal + 20.0),
        spread=np.array((place, place, turn)),
        seed=seed,
    )


def drive(
    robot: Robot, seed: int, family: str = "open", model: KoopmanModel | None = None
) -> DriveResult:
    """Learn a robot and drive it over one random map of its size."""
    model = learn(robot, seed) if model is None else model
    plant = RobotPlant(robot, seed)
    return drive_course(
        robot, seed, lambda side: (Controller(model, robot.problem(side)), plant), family
    )


def drive_named(name: str, seed: int) -> DriveResult:
    """Drive one of `ROBOTS`; the seed is that of map, slip and noise."""
    return drive(ROBOTS[name], seed)


def drive_random(wheels: str, seed: int) -> DriveResult:
    """Draw a robot on some wheels, learn it and drive it over one random map of its size."""
    if wheels in ("differential", "round"):
        return drive(random_robot(seed, wheels == "differential"), seed)
    robot = (draw_car if wheels == "car" else draw_omni)(seed)
    model, problem, plant = robot.ready(seed)

    def ready(side: float) -> tuple[Controller, Moves]:
        area = np.array((0.5 * side, 0.5 * side, np.inf))
        return Controller(model, replace(problem, x_min=-area, x_max=area)), plant

    return drive_course(robot, seed, ready)
