"""Speed against reach: how fast robots with real accelerations drive by what they see ahead.

A robot drives along an empty floor and is told of circles within a reach; there are none. The law
is the speed from which it stops within the reach: ``v t + v^2 / 2 a = reach``, with its
deceleration a and one and a half periods t until a change of its command acts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from kmpc_lab.sim.periods import periods
from kmpc_lab.studies.accelerations import KNOWS, ROBOTS, model_of, problem_of, robot_of
from kmpc_lab.studies.any_robot import RobotPlant
from kmpc_lab.studies.records import Work
from kmpc_lite.control import Controller
from kmpc_lite.control.plan import Plan
from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

REACHES = 0.5, 1.0, 2.0, 4.0
REACTION = 1.5
"""Periods until a change of the command acts."""
SECONDS = 10.0
"""How long it drives at its speed after it has come to it [s]."""
SIDE = 400.0
"""Of the area [m]."""


@dataclass(frozen=True)
class Point:
    """How fast a robot drives with a reach."""

    robot: str
    knows: str
    reach: float
    speed: float
    """Median of the second half of the drive [m/s]; 0 if the reach is refused."""
    law: float


def sight_law(name: str, reach: float) -> float:
    """Speed from which a robot stops within its reach [m/s]."""
    (speed, ramp, _), time = ROBOTS[name], REACTION * robot_of(name).dt
    return min(ramp * (math.sqrt(time**2 + 2.0 * reach / ramp) - time), speed)


def drive(name: str, reach: float, knows: str) -> Point:
    """Drive straight on."""
    robot, law = robot_of(name), sight_law(name, reach)
    half = 0.5 * SIDE
    start, goal = np.array((-half, 0.0, 0.0)) * 0.9, (0.9 * half, 0.0, 0.0)
    try:
        controller = Controller(model_of(name, knows), problem_of(robot, SIDE, knows, reach))
    except ProblemError:
        return Point(name, knows, reach, 0.0, law)

    def step(pose: Array, k: int) -> Plan:
        return controller.step(pose, goal, [])

    most = math.ceil((2.0 * law / ROBOTS[name][1] + SECONDS) / robot.dt)
    driven = periods(step, RobotPlant(robot, 1).drive, start, most)
    speeds = [float(period.plan.command[0]) for period in driven]
    return Point(name, knows, reach, float(np.median(speeds[len(speeds) // 2 :])), law)


def study(work: Work, names: Sequence[str]) -> list[Point]:
    """Drive all robots with all reaches."""
    return work.rows("limits --curve", product(names, REACHES, KNOWS), drive, Point)


def format_points(points: Sequence[Point]) -> str:
    """Table of speed against reach."""
    lines = [f"{'':32} reach    law  " + "  ".join(f"{knows:>8} share" for knows in KNOWS)]
    for name, reach in dict.fromkeys((p.robot, p.reach) for p in points):
        some = {p.knows: p for p in points if (p.robot, p.reach) == (name, reach)}
        law = some[KNOWS[0]].law
        lines.append(
            f"{name:32} {reach:5g} {law:6.2f}  "
            + "  ".join(f"{some[k].speed:8.2f} {some[k].speed / law:5.2f}" for k in KNOWS)
        )
    return "\n".join(lines)
