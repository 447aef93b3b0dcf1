"""kmpc_lite's controller as the bridge calls it: to the goal that a topic names."""

from __future__ import annotations

import math
import time
from collections import Counter
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from firmware_bridge.messages import Speeds, State, VelocityCommand, command_of, speeds_of
from firmware_bridge.ros2.inputs import Goal, Inputs
from firmware_bridge.runtime.navigator import figures, goal_errors

if TYPE_CHECKING:
    from kmpc_lite.control.controller import Controller
    from kmpc_lite.control.plan import Plan

WAITS = "waits for a goal"


class GoalNavigator:
    """Drives to one goal after another.

    Parameters
    ----------
    controller : Controller
        Plans.
    inputs : Inputs
        Goals and obstacles.
    settle : float
        How long a goal is held until it counts as reached [s].
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        controller: Controller,
        inputs: Inputs,
        settle: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._controller = controller
        self._inputs = inputs
        self._settle = settle
        self._clock = clock
        self.goal: Goal | None = None
        self.plan: Plan | None = None
        """Newest, while there is a goal."""
        self.said = WAITS
        """What it does, in words."""
        self.reason = ""
        """Why the newest plan is none that drives to the goal, in words; else empty."""
        self.obstacles: list[Any] = []
        """Those of the newest plan."""
        self.watchers: list[Callable[[Any, Any], None]] = []
        """Receive each pose and plan, in the thread that plans."""
        self.reached = 0
        """Number of goals that were reached."""
        self.started = 0
        """Number of goals that were begun."""
        self.statuses: Counter[str] = Counter()
        self.clearance = math.inf
        """Smallest distance to what was seen so far [m]."""
        self._holding_since: float | None = None
        self._began = self._reached_at = math.inf
        self._last: tuple[State, Goal] | None = None

    def __call__(self, state: State, held: Speeds | None) -> VelocityCommand:
        """Plan from a pose.

        `held` is the mean command on the wire since the last plan, None if it is not known.
        """
        now = self._clock()
        self._take_goal()
        goal = self.goal
        if goal is None:
            return VelocityCommand(0.0, 0.0, now)
        obstacles = self._inputs.obstacles(state.stamp, now)
        if obstacles is None:
            # the gate knows why, and stops the robot
            self.plan, self.said = None, "waits for obstacles"
            return VelocityCommand(0.0, 0.0, now)
        inputs = self._controller.problem.wheels.inputs
        place = (state.x, state.y, state.theta)
        self._began, self._last = min(self._began, now), (state, goal)
        plan = self._controller.step(place, goal, obstacles, sent=command_of(held, inputs))
        self.plan, self.obstacles = plan, obstacles
        for saw in self.watchers:
            saw(place, plan)
        self.statuses[plan.status.name] += 1
        self.reason = plan.reason
        self.said = f"{plan.progress.value}{plan.reason and ': '}{plan.reason}"
        self.clearance = min(self.clearance, float(plan.around.clearance(np.array([place]))))
        self._judge(plan, now)
        v, omega, vy = speeds_of(plan.command)
        return VelocityCommand(v, omega, now, vy)

    def _take_goal(self) -> None:
        """Begin with a goal that is new."""
        newest, self._inputs.goal = self._inputs.goal, None
        if newest is None:
            return
        if self.goal is None:
            self._controller.reset()  # what was long ago tells nothing of now
        self.goal, self._holding_since = newest, None
        self.started += 1

    def _judge(self, plan: Plan, now: float) -> None:
        """Tell whether the goal has been held for long enough."""
        if not plan.holding:
            self._holding_since = None
        elif self._holding_since is None:
            self._holding_since = now
        elif now - self._holding_since >= self._settle:
            self.goal, self.plan, self.said = None, None, "goal reached"
            self.reached, self._reached_at = self.reached + 1, self._holding_since

    @property
    def arrived(self) -> bool:
        """Whether every goal that was begun was reached."""
        return self.reached == self.started > 0

    def duration(self) -> float:
        """From the first plan until the last goal was reached, else until now [s]."""
        end = self._reached_at if self.arrived else self._clock()
        return max(0.0, end - self._began)

    def errors(self) -> tuple[float, float]:
        """Distance to the goal [m] and heading error [rad] of the last pose; infinite without."""
        return (math.inf, math.inf) if self._last is None else goal_errors(*self._last)

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        after = self.duration() if self.arrived else None
        return {
            "goals_reached": self.reached,
            "goals_begun": self.started,
            **figures(self.duration(), after, self.errors(), self.clearance),
            "statuses": dict(self.statuses),
        }
