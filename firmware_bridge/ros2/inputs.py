"""All that the node hears, and what keeps the robot from driving by it."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

from firmware_bridge.messages import State
from firmware_bridge.ros2.clock import RosClock
from firmware_bridge.ros2.message_types import CLOCK, GRID, GRID_UPDATE, ODOMETRY, POSE, SCAN, TF
from firmware_bridge.ros2.names import Qos
from firmware_bridge.ros2.obstacles import GridInput, ScanInput
from firmware_bridge.ros2.options import Ros2Options
from firmware_bridge.ros2.pose import PoseInput
from firmware_bridge.ros2.transforms import Transforms, bare, planar, pose_matrix

NEWEST = Qos(depth=1)
SENSOR = Qos(reliable=False, depth=1)
LATCHED = Qos(transient_local=True, depth=1)
"""As map servers publish: whoever comes late gets the last map."""
TREE = Qos(depth=100)
STATIC = Qos(transient_local=True, depth=100)
UPDATES = Qos(depth=50)


class Source(NamedTuple):
    """A topic that is subscribed to, and the receiver of its messages."""

    name: str
    kind: str
    qos: Qos
    take: Callable[[Any, float], None]
    """With the message, and the time at which it came [s]."""
    slow: bool = False
    """Whether a message may take long."""


class Goal(NamedTuple):
    """Where to drive, in the frame that is driven in."""

    x: float
    """[m]"""
    y: float
    """[m]"""
    theta: float
    """[rad]"""


class Inputs:
    """Poses, obstacles and goals that topics tell.

    Parameters
    ----------
    options : Ros2Options
        Which topics, and how far they are believed.
    """

    def __init__(self, options: Ros2Options) -> None:
        self._options = options
        self.clock = RosClock(options.simulated_time)
        self.transforms = Transforms(options.transform_age)
        self.pose = PoseInput(options.frame, options.base, self.transforms, self.clock)
        self.grids = [
            GridInput(name, options.frame, self.transforms, options.grid)
            for name in options.topics["map"]
        ]
        self.scans = [
            ScanInput(name, self.transforms, self.pose, options.scan_age, options.mount)
            for name in options.topics["scan"]
        ]
        self.goal: Goal | None = None
        """Newest; whoever drives there takes it away."""
        self.goals = 0
        """Number of goals that were taken."""
        self.refused_goal = ""
        """Why the newest goal was not taken."""

    def sources(self) -> list[Source]:
        """Subscriptions that are needed."""
        o, pose = self._options, self.pose
        found = [
            Source(o.topics["tf"][0], TF, TREE, self._take_tf),
            Source(o.topics["tf_static"][0], TF, STATIC, self._take_static),
        ]
        if not o.pose_from_tf:
            found.append(Source(o.topics["odom"][0], ODOMETRY, SENSOR, pose.take_odometry))
        if o.simulated_time:
            found.append(Source(o.topics["clock"][0], CLOCK, SENSOR, self.clock.take))
        if (name := o.topic("goal")) is not None:
            found.append(Source(name, POSE, NEWEST, self.take_goal))
        found += [Source(scan.name, SCAN, SENSOR, scan.take) for scan in self.scans]
        for grid in self.grids:
            found.append(Source(grid.name, GRID, LATCHED, grid.take, slow=True))
            found.append(
                Source(f"{grid.name}_updates", GRID_UPDATE, UPDATES, grid.update, slow=True)
            )
        return found

    def take_goal(self, message: Any, now: float) -> None:
        """Take a PoseStamped that came at `now` [s]."""
        frame = bare(message.header.frame_id)
        matrix = pose_matrix(message.pose.position, message.pose.orientation)
        found = self.transforms.lookup(self._options.frame, frame, now) if frame else None
        if matrix is None or found is None:
            reason = "it is not finite, or has no orientation"
            if matrix is not None:
                reason = f"no transform {self._options.frame} -> {frame or '(no frame)'}"
            self.refused_goal = f"goal refused: {reason}"
            return
        at = planar(found @ matrix)
        self.refused_goal = ""
        self.drive_to(Goal(at.x, at.y, at.theta))

    def drive_to(self, goal: Goal) -> None:
        """Take a goal, of whomever."""
        self.goal, self.goals = goal, self.goals + 1

    def build(self, now: float) -> None:
        """Make grids of new maps."""
        for grid in self.grids:
            grid.build(now)

    def state(self, now: float) -> State | None:
        """Newest pose."""
        return self.pose.state(now)

    def obstacles(self, at: float, now: float) -> list[Any] | None:
        """Obstacles for a robot whose pose is of the time `at` [s]; None if one is missing."""
        grids = [grid.grid for grid in self.grids]
        scans = [scan.scan(at, now) for scan in self.scans]
        found = [*grids, *scans]
        return None if any(one is None for one in found) else found

    def problems(self, now: float) -> tuple[str, ...]:
        """Why the robot must not drive by its map or its time, in words; empty if it may."""
        found = (
            self.clock.problem(now),
            self.pose.filter.fault(now),
            *(grid.problem(now) for grid in self.grids),
        )
        return tuple(text for text in found if text)

    def blind(self, now: float) -> tuple[str, ...]:
        """Why scanners do not tell what is around the robot, in words; empty if all do."""
        found = (scan.problem(now) for scan in self.scans)
        return tuple(text for text in found if text)

    def clock_offset(self, now: float) -> float | None:
        """How far our system's clock is ahead of the odometry's [s]; None if not known."""
        way = self.pose.filter.shortest_way
        if self._options.simulated_time or math.isnan(way):
            return None
        return self.clock.offset(way, now)

    def _take_tf(self, message: Any, now: float) -> None:
        self.transforms.take(message, now, static=False)
        if self._options.pose_from_tf:
            self.pose.take_transforms(now)

    def _take_static(self, message: Any, now: float) -> None:
        self.transforms.take(message, now, static=True)
