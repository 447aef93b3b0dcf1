"""From a planner of poses to the bridge's controller, watching goal and obstacles."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from firmware_bridge.messages import State, VelocityCommand

Pose = tuple[float, float, float]
Circles = Any
"""Rows x, y, radius [m], and whatever the planner wants to know more: an array or a list of
lists."""
Step = Callable[[Pose, Circles], tuple[float, float, str]]
"""Pose and obstacles -> v [m/s], omega [rad/s] and a word on how the plan came about."""


@dataclass(frozen=True)
class Task:
    """Where to go, and past what."""

    goal: Pose
    tolerance: float
    """[m]"""
    heading_tolerance: float
    """[rad]"""
    radius: float
    """Of the robot [m]."""
    circles_at: Callable[[float], Circles]
    """Obstacles at a time since the beginning of the drive [s]."""


class Navigator:
    """A controller for the bridge that knows when it has arrived.

    Time counts from the moment in which the gate first lets commands pass.

    Parameters
    ----------
    step : callable
        Plans; see `Step`.
    task : Task
        Goal and obstacles.
    settle : float
        How long the goal must be held [s].
    seconds : float
        Give up after so long [s].
    clock : callable
        [s]
    """

    def __init__(
        self,
        step: Step,
        task: Task,
        settle: float,
        seconds: float,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._step, self._task, self._settle, self._seconds, self._clock = (
            step,
            task,
            settle,
            seconds,
            clock,
        )
        self.is_driving: Callable[[], bool] = lambda: False
        """Whether commands pass; set once there is a gate."""
        self.held: Callable[[], tuple[float, float] | None] = lambda: None
        """Mean command on the wire since the last plan; set once there is a planner."""
        self._began: float | None = None
        self._inside_since: float | None = None
        self._last: State | None = None
        self.arrived_after: float | None = None
        """From the beginning until the goal was reached and then held [s]."""
        self.clearance = math.inf
        """Smallest distance between the edges of robot and obstacles so far [m], by the measured
        pose."""
        self.statuses: Counter[str] = Counter()

    def __call__(self, state: State) -> VelocityCommand:
        """Plan from a pose."""
        now = self._clock()
        if self._began is None and self.is_driving():
            self._began = now
        circles = self._task.circles_at(self.elapsed(now))
        if self._began is not None:
            self._judge(state, circles, now)
        v, omega, status = self._step((state.x, state.y, state.theta), circles)
        if self._began is not None:
            self.statuses[status] += 1
        return VelocityCommand(v, omega, self._clock())

    def elapsed(self, now: float) -> float:
        """Time since the beginning [s]."""
        return 0.0 if self._began is None else now - self._began

    def finished(self) -> bool:
        """Whether the goal is held, or time is up."""
        return self.arrived_after is not None or self.elapsed(self._clock()) > self._seconds

    def errors(self) -> tuple[float, float]:
        """Distance to the goal [m] and heading error [rad] of the last pose; infinite without."""
        if self._last is None:
            return math.inf, math.inf
        x, y, theta = self._task.goal
        return math.hypot(self._last.x - x, self._last.y - y), abs(
            math.remainder(self._last.theta - theta, math.tau)
        )

    def _judge(self, state: State, circles: Circles, now: float) -> None:
        self._last = state
        for x, y, radius, *_ in circles:
            self.clearance = min(
                self.clearance, math.hypot(state.x - x, state.y - y) - radius - self._task.radius
            )
        distance, turn = self.errors()
        if distance > self._task.tolerance or turn > self._task.heading_tolerance:
            self._inside_since = None
        elif self._inside_since is None:
            self._inside_since = now
        elif now - self._inside_since >= self._settle and self.arrived_after is None:
            assert self._began is not None
            self.arrived_after = self._inside_since - self._began

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        distance, turn = self.errors()
        return {
            "arrived": self.arrived_after is not None,
            "arrived_after_s": None if self.arrived_after is None else round(self.arrived_after, 3),
            "position_error_m": None if math.isinf(distance) else round(distance, 4),
            "heading_error_rad": None if math.isinf(turn) else round(turn, 4),
            "clearance_m": None if math.isinf(self.clearance) else round(self.clearance, 4),
            "statuses": dict(self.statuses),
        }
