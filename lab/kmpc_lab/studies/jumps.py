"""Study ``jumps``: drives whose pose jumps again and again.

The pose that the controller is given is wrong for one sample, or for a second, in position or in
heading, and true again; or the frame of poses and obstacles moves for good. A drive ends where the
robot first is within the tolerances of its goal, in the frame as it is then: it need not stay.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from kmpc_lab.sim.maps import random_map
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.studies.contenders import DT
from kmpc_lab.studies.drive import DriveResult, Task, closed_loop
from kmpc_lab.studies.table import DRIVES, SECONDS, Column, mean_of
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import GoalProgress, Plan
from kmpc_lite.model.koopman import nominal_unicycle
from kmpc_lite.scenario.touch import LOOKS
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

FAMILY = "dense"
BETWEEN = (2.0, 5.0)  # time from the end of a jump to the next one [s]
LASTS = 1.0  # how long a pose stays wrong, where it is not for a single sample [s]
TIMEOUT = 60.0  # [s]
SLIP = 0.05
COLUMNS = (
    *DRIVES,
    SECONDS,
    Column("jumps", ".1f", mean_of("jumps")),
    Column("waits [s]", ".1f", mean_of("waited")),
)


class Jumps:
    """When the pose is wrong, and by how much.

    `kind`: ``one sample``, ``a second``, ``heading`` or ``for good``. `size`: [m], of a heading
    [rad]. `seed`: of times and directions.
    """

    def __init__(self, kind: str, size: float, seed: int) -> None:
        self._kind, self._size = kind, size
        self._random = np.random.default_rng([seed, 5])
        self.count = 0
        self.frame = np.zeros(3)  # by how much the frame has moved for good
        self._off = np.zeros(3)
        self._begin = self._random.uniform(*BETWEEN)
        self._end = math.inf

    def at(self, time: float) -> Array:
        """By how much the pose is wrong (3,) at a time [s], beside the frame."""
        if time >= self._end:
            self._off, self._end = np.zeros(3), math.inf
            self._begin = time + self._random.uniform(*BETWEEN)
        if time >= self._begin:
            self._begin = math.inf
            self._jump(time)
        return self._off

    def _jump(self, time: float) -> None:
        self.count += 1
        direction = self._random.uniform(-math.pi, math.pi)
        off = self._size * np.array([math.cos(direction), math.sin(direction), 0.0])
        if self._kind == "heading":
            off = np.array([0.0, 0.0, math.copysign(self._size, direction)])
        if self._kind == "for good":
            self.frame, self._end = self.frame + off, time
        else:
            self._off = off
            self._end = time + (0.5 * DT if self._kind == "one sample" else LASTS)


def drive(kind: str, size: float, seed: int) -> DriveResult:
    """Drive one map; jumps are of a size [m, of a heading rad]."""
    scenario = random_map(FAMILY, seed, SLIP)
    controller = Controller(nominal_unicycle(DT), problem := scenario.problem())
    jumps, plant = Jumps(kind, size, seed), DifferentialDrive(SLIP, seed)
    start, goal, circles = *map(np.array, (scenario.start, scenario.goal)), scenario.circles_at(0.0)
    waited = 0

    def step(pose: Array, k: int) -> Plan:
        nonlocal waited
        off, frame = jumps.at(k * DT), jumps.frame
        given = circles + (*frame[:2], 0.0, 0.0, 0.0)
        plan = controller.step(pose + off + frame, goal, given)
        waited += plan.progress is GoalProgress.WAITING
        return plan

    task = Task(
        start,
        goal,
        lambda pose: bool(scenario.arrival.met(pose + jumps.frame, goal)),
        lambda poses: obstacle_gaps(scenario, poses, np.zeros(LOOKS)),
        math.dist(start[:2], goal[:2]) / problem.u_max[0],
        TIMEOUT,
        np.array(problem.u_max),
        DT,
        held=0.0,
        around=scenario.circles,
    )
    row = closed_loop(step, lambda pose, u: plant.trace(pose, u, DT, LOOKS), task)
    return replace(row, more={"jumps": jumps.count, "waited": waited * DT})
