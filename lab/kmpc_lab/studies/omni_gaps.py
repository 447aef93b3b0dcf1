"""Omnis where only moving sideways, or a narrow door, leads: learned from their own logs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lab.sim.plants.steered import Follower, Rollers
from kmpc_lab.studies.any_wheels import OmniRobot
from kmpc_lab.studies.drive import DriveResult, drive_past
from kmpc_lab.studies.parking import box
from kmpc_lite.control import Controller, Footprint, Polygon
from kmpc_lite.types import Array

LENGTH, WIDTH, ROUND = 0.5, 0.36, 0.2
"""Of the mecanum robot, and radius of the one on three wheels [m]."""
WHEELS = Rollers(
    Follower(0.04, (2.0, 2.0, 6.0), (0.1, 0.1, 0.1)), (0.97, 0.95, 0.8, 0.9), 0.1, slip=0.04
)
"""Less sideways than ahead, as rollers do, late by a tenth of a second, and slipping."""
ROBOTS = {
    "sideways": OmniRobot(
        "mecanum",
        WHEELS,
        Footprint.rectangle(LENGTH, WIDTH),
        0.5 * math.hypot(LENGTH, WIDTH),
        *((0.6, 0.5, 1.5), 0.1, (0.005, 0.01)),
    ),
    "door": OmniRobot("three wheels", WHEELS, None, ROUND, (0.6, 0.6, 1.5), 0.1, (0.005, 0.01)),
}
SLOT, DOOR, THICK = 0.1, 0.08, 0.1
"""How much longer than the robot its slot is, what a door leaves on each side, and walls [m]."""


def scene_of(kind: str, seed: int) -> tuple[Array, Array, list[Polygon]]:
    """Start (3,), goal (3,) and solids: a slot along a wall, or a wall with a door."""
    random = np.random.default_rng([seed, 89])
    x, y = random.uniform((-1.5, 0.8), (1.5, 1.4))
    if kind == "sideways":
        half, deep = 0.5 * (LENGTH + SLOT), WIDTH + 0.1
        solids = [
            box(-2.0, -deep, -half, 0.0),
            box(half, -deep, 2.0, 0.0),
            box(-2.0, -deep - THICK, 2.0, -deep),
        ]
        start = np.array((x, y, random.uniform(-math.pi, math.pi)))
        return start, np.array((0.0, -0.5 * deep, 0.0)), solids
    half = ROUND + DOOR
    solids = [box(-3.0, -THICK, -half, 0.0), box(half, -THICK, 3.0, 0.0)]
    turn, away = random.uniform(-math.pi, math.pi, 2), random.uniform((-1.5, -1.6), (1.5, -1.0))
    return np.array((x, y, turn[0])), np.array((*away, turn[1])), solids


def drive(kind: str, seed: int) -> DriveResult:
    """Learn the robot, and drive it into its slot, or through its door."""
    robot = ROBOTS[kind]
    start, goal, solids = scene_of(kind, seed)
    ready, area = robot.ready(seed), np.array((3.0, 3.0, np.inf))
    problem = replace(ready.problem, x_min=-area, x_max=area)
    ideal = robot.ideal(start, goal)
    place, turn = robot.noise
    return drive_past(
        Controller(ready.model, problem),
        ready.plant.drive,
        (start, goal),
        solids,
        (ideal, 5.0 * ideal + 30.0),
        spread=np.array((place, place, turn)),
        seed=seed,
    )
