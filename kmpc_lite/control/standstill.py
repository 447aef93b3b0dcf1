"""Whether the robot stands for long, and whether its commands would have moved it.

A robot that neither moves nor turns, whatever the cause, is never told to be driving: the guide may
see a path, the solver a solution, and the motors be off.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.mobility import reached_speeds
from kmpc_lite.control.options import (
    GuidanceOptions,
    lengths_from_radii,
    unit_length,
)
from kmpc_lite.control.path.progress_checker import NOWHERE, STALL_DISTANCE
from kmpc_lite.control.plan import NO_PROGRESS, UNSEEN, GoalProgress
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.arguments import speeds
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

STALL_ANGLE = 0.5
"""A robot that turns by more than this is not told to stand still [rad]; turning brings it no
nearer to its goal by itself."""

STALLS = 2.0
"""A robot stands for long after this many times the guide's `stall_time`."""
LITTLE = 0.1
"""Share of its fastest speed and turn rate below which a robot is hardly commanded to move."""


@dataclass(slots=True)
class StandstillState:
    """Where the robot stands, and what it was commanded there."""

    anchor: tuple[float, float, float] = NOWHERE
    """Pose that it has not moved away from [m, m, rad]."""
    goal: tuple[float, float, float] = NOWHERE
    """Its goal meanwhile: another one is a new beginning."""
    time: float = 0.0
    """Since it came there [s]."""
    way: float = 0.0
    """How far its commands would have driven it since [m] ..."""
    turn: float = 0.0
    """... and turned it [rad], whichever way."""


class Present(NamedTuple):
    """A robot at the beginning of a period."""

    pose: Array
    """(3,)"""
    goal: Array
    """(3,)"""
    command: Array
    """(2,) that it is given."""
    guided: bool
    """Whether a guide leads it."""


class StandstillWatch:
    """Watches for a robot that stands.

    Parameters
    ----------
    units : NavigationProblem
        In the robot's units.
    scale : Scale
        The robot's units.
    options : GuidanceOptions
        What counts as movement, and for how long there may be none.
    """

    def __init__(self, units: NavigationProblem, scale: Scale, options: GuidanceOptions) -> None:
        options = lengths_from_radii(options, unit_length(units))
        self._dt, self._scale = units.dt, scale
        self._distance, self._angle = STALL_DISTANCE, STALL_ANGLE
        self._longest = STALLS * options.stall_time
        self._little = LITTLE * np.abs(reached_speeds(units))

    def tell(
        self, state: StandstillState, now: Present, reason: str, progress: GoalProgress
    ) -> tuple[str, GoalProgress]:
        """Give reason and progress, with why the robot has stood where it has stood for long."""
        at_goal = math.hypot(*(now.pose - now.goal)[:2]) <= self._distance
        # without guidance a robot at its goal is told to be driving
        drives = progress is GoalProgress.DRIVING and (now.guided or not at_goal)
        drives = drives or reason.startswith((NO_PROGRESS, UNSEEN))
        stands = self._see(state, now, drives)
        if not stands:
            return reason, progress
        return "; ".join(filter(None, (reason, stands))), GoalProgress.WAITING

    def _see(self, state: StandstillState, now: Present, drives: bool) -> str:
        """Let a period pass; why the robot has stood for long, empty as long as it has not.

        A robot that does not drive, but waits or holds, begins anew when it drives.
        """
        x, y, heading = now.pose.tolist()
        aim: tuple[float, float, float] = tuple(now.goal.tolist())
        x_then, y_then, heading_then = state.anchor
        moved = math.hypot(x - x_then, y - y_then) > self._distance
        moved = moved or not drives or aim != state.goal
        # a place that is nowhere has no heading
        if moved or abs(math.remainder(heading - heading_then, math.tau)) > self._angle:
            state.anchor, state.goal = (x, y, heading), aim
            state.time = state.way = state.turn = 0.0
        elif state.time > self._longest and (why := self._why(state)):
            return why
        speed, turn_rate = speeds(now.command).tolist()
        state.time += self._dt
        state.way += abs(speed) * self._dt
        state.turn += abs(turn_rate) * self._dt
        return ""

    def _why(self, state: StandstillState) -> str:
        """What a user can do about it; nothing of a robot that is slow."""
        seconds, way = state.time * self._scale.time, state.way * self._scale.length
        stands = f"the robot has not moved for {seconds:.3g} s"
        asked = f"by {way:.2g} m and {state.turn:.2g} rad"
        if state.way > self._distance or state.turn > self._angle:
            return (
                f"{stands}, though it was commanded to, {asked}: motors off, wheels blocked, or "
                "poses that do not change"
            )
        if (np.array((state.way, state.turn)) < state.time * self._little).all():
            return (
                f"{stands}: its commands would have moved it {asked} only; its limits, its model, "
                "or what stands beside it allow no more"
            )
        return ""
