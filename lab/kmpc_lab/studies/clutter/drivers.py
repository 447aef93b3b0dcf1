"""The robot of the study of clutter, what it measures, and what drives it."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import cache
from time import process_time
from typing import Protocol

import numpy as np

from kmpc_lab.studies.any_robot import Robot, learn
from kmpc_lab.studies.clutter.dwa import Dwa
from kmpc_lab.studies.clutter.worlds import Cylinders
from kmpc_lab.studies.sight.pursuit import Pursuit
from kmpc_lite.control import Controller, ControllerOptions, Footprint, LaserScan
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

SIZE = (0.51, 0.43)
"""Length and width [m]."""
OUTLINE = Footprint.rectangle(*SIZE)
JACKAL = Robot(
    "Jackal",
    0.5 * math.hypot(*SIZE),
    2.0,
    4.0,
    dt=0.05,
    lag=0.06,
    ramps=(2.0 / 4.9, 2.0 / 4.9),
    slip=0.03,
    seconds=180.0,
    footprint=OUTLINE,
)
"""Changes its speed by 4.9 m/s^2 and its turn rate by 9.8 rad/s^2."""
LOG_SEED = 31
"""Of the log that it is learned from."""
BEAMS, VIEW, REACH, MOUNT = 720, 1.5 * math.pi, 10.0, 0.055
"""Of its lidar: beams, field of view [rad], reach, and how far ahead it sits [m]."""
FREE = 3.0
"""How far around it there is nothing where it begins [radii]: a metre."""
PURSUES = 1.0
"""Speed of pure pursuit [m/s]: it knows of no braking."""


@dataclass(frozen=True)
class Condition:
    """How well poses and ranges are measured."""

    place: float
    """Standard deviation of a pose [m]."""
    heading: float
    """Of its heading [rad]."""
    ranges: float
    """Of a range [m]."""
    late: int = 0
    """Age of poses and scans, which no driver knows [periods]."""
    drift: float = 0.0
    """Share by which odometry counts too much of what is driven and turned."""


CONDITIONS = {
    "exact": Condition(0.002, math.radians(0.1), 0.001),
    "noisy": Condition(0.01, math.radians(0.5), 0.01),
    "late": Condition(0.002, math.radians(0.1), 0.001, late=1, drift=0.015),
}
"""``exact``: as in Gazebo; ``noisy``: 1 cm, 0.5 degrees; ``late``: exact, but one period of age
that no driver knows, and odometry that drifts by 1.5 %."""


class Driver(Protocol):
    """Decides by what is measured."""

    def command(self, pose: Array, ranges: Array) -> Array:
        """Command (2,) for a pose (3,) and ranges (BEAMS,)."""
        ...


class Ours:
    """The controller, with scans alone."""

    def __init__(self, world: Cylinders, condition: Condition) -> None:
        x1, y1, x2, y2 = world.bounds
        problem = replace(
            JACKAL.problem(1.0), x_min=(x1, y1, -np.inf), x_max=(x2, y2, np.inf), sensor_range=REACH
        )
        options = ControllerOptions(sight=SightOptions(free_at_start=FREE))
        # what other work on the machine takes does not count
        self.controller = Controller(
            model_of(condition), problem, options=options, clock=process_time
        )
        self.goal, self.noise = world.goal, condition.ranges
        self.statuses: list[PlanStatus] = []
        self.times: list[float] = []
        self.ended = ""

    def command(self, pose: Array, ranges: Array) -> Array:
        """Plan."""
        step = VIEW / (BEAMS - 1)
        scan = LaserScan(
            ranges, -0.5 * VIEW, step, REACH, 0.05, (MOUNT, 0.0, 0.0), noise=self.noise
        )
        plan = self.controller.step(pose, self.goal, [scan])
        self.statuses.append(plan.status)
        self.times.append(1e3 * plan.timing["total"])
        self.ended = f"{plan.progress.value}: {plan.reason}"
        return plan.command


class Theirs:
    """Pure pursuit, or the dynamic window, of the points that beams hit."""

    def __init__(self, name: str, world: Cylinders) -> None:
        x1, y1, x2, y2 = world.bounds
        fastest = (JACKAL.speed, JACKAL.turn_rate)
        self.middle, self.goal = np.zeros(3), world.goal
        if name == "dwa":
            ramps = (fastest[0] / JACKAL.ramps[0], fastest[1] / JACKAL.ramps[0])
            self.drives = Dwa(world.bounds, SIZE, fastest, ramps, JACKAL.dt).command
        else:
            # its area is a square about the origin; its circle turns within the outline's
            self.middle = np.array([0.5 * (x1 + x2), 0.5 * (y1 + y2), 0.0])
            pursuit = Pursuit(0.29, PURSUES, 2.0, max(x2 - x1, y2 - y1))
            self.drives = lambda pose, goal, ends: pursuit.command(pose, goal, ends, 0.1)

    def command(self, pose: Array, ranges: Array) -> Array:
        """Decide."""
        hit = np.isfinite(ranges)
        along = pose[2] + np.linspace(-0.5, 0.5, BEAMS)[hit] * VIEW
        origin = pose[:2] + MOUNT * np.array([math.cos(pose[2]), math.sin(pose[2])])
        ends = origin + ranges[hit, None] * np.stack([np.cos(along), np.sin(along)], axis=1)
        middle = self.middle
        return self.drives(pose - middle, self.goal - middle, ends - middle[:2])


DRIVERS = "ours", "dwa", "pursuit"


@cache
def model_of(condition: Condition) -> KoopmanModel:
    """Learn the robot from its log, measured as well as when it drives."""
    noisy = replace(JACKAL, noise=(condition.place, condition.heading))
    return learn(noisy, LOG_SEED)
