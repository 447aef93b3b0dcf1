"""A shuttle: away along the goal's axis and back, where turning on the spot takes longer.

A robot that has stopped beside its goal, by more than it may begin its last turn at, would turn to
drive there and turn back: up to half a circle, and each turn moves a robot that slips. Where it is
nearly aligned it is quicker to drive away from the goal, along the axis of the goal's heading, and
to come back in the other gear.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.path.planner import distances_around
from kmpc_lite.control.path.situation import Situation
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids

SHUTTLE_LENGTH = 0.3
"""A robot that has stopped beside its goal may drive a shuttle: away from the goal along the axis
of its heading, and back. This is how far away [m]."""
SHUTTLE_GAIN = 1.0
"""How much quicker than turning on the spot a shuttle must be [s]."""
SHUTTLE_SPEED = 0.5
"""Share of its speed at which the robot drives a shuttle: it slips more at speed."""


class ShuttleFinder:
    """Tells whether a shuttle is quicker, and where it turns back.

    Parameters
    ----------
    problem : NavigationProblem
        Radius, margin and area.
    """

    def __init__(self, problem: NavigationProblem) -> None:
        self._length, self._gain = SHUTTLE_LENGTH, SHUTTLE_GAIN
        self._slow = np.array([SHUTTLE_SPEED, 1.0])
        self._inflation = problem.robot_radius + problem.margin
        self._low, self._high = problem.x_min[:2], problem.x_max[:2]

    def find(self, now: Situation, solids: Solids | None, coarse: float) -> Array | None:
        """Pose (3,) at which a shuttle turns back; None where turning on the spot is quicker.

        Parameters
        ----------
        now : Situation
            Of this step.
        solids : Solids, optional
            All that are known.
        coarse : float
            How far these may stand out of what was hit [m].
        """
        forward, backward = now.capabilities.forward, now.capabilities.backward
        if backward[0] <= 0.0:
            return None
        directly = min(
            _time_of_leg(now.pose, now.goal, speed, turned)
            for speed, turned in ((forward, 0.0), (backward, math.pi))
        )
        x, y, heading = now.goal.tolist()
        ahead = self._length * np.array([math.cos(heading), math.sin(heading)])
        best, best_time = None, directly - self._gain
        # behind the goal in reverse, or before it: back in the other gear
        gears = backward * self._slow, forward * self._slow
        for side, out, back in ((-1.0, *gears), (1.0, *gears[::-1])):
            pose = np.array([x + side * ahead[0], y + side * ahead[1], heading])
            time = _time_of_leg(now.pose, pose, out, math.pi if side < 0.0 else 0.0)
            time += self._length / float(back[0])
            if time < best_time and self._is_free(pose, now.circles, solids, coarse):
                best, best_time = pose, time
        return best

    def _is_free(self, pose: Array, circles: Array, solids: Solids | None, coarse: float) -> bool:
        """Whether the robot can stand at a pose (3,): in the area, and off all obstacles."""
        if not ((pose[:2] >= self._low).all() and (pose[:2] <= self._high).all()):
            return False
        around = distances_around(pose[None, :2], circles, solids, coarse)
        return float(around[0]) >= self._inflation


def _time_of_leg(begin: Array, end: Array, speed: Array, turned: float) -> float:
    """Time of turning on the spot, driving straight, and turning to the end's heading [s].

    Parameters
    ----------
    begin, end : ndarray
        Poses (3,).
    speed : ndarray
        Speed [m/s] and rate of turn [rad/s], (2,).
    turned : float
        Angle from the robot's course to its heading: pi in reverse [rad].
    """
    dx, dy = (end - begin)[:2].tolist()
    course = math.atan2(dy, dx) + turned
    turns = abs(wrap(course - float(begin[2]))) + abs(wrap(float(end[2]) - course))
    return turns / float(speed[1]) + math.hypot(dx, dy) / float(speed[0])
