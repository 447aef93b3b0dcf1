"""From what was decided to a `Plan` in metres and seconds, and to what `logging` is told.

A robot that neither moves nor turns, whatever the cause, is never told to be driving: the guide may
see a path, the solver a solution, and the motors be off. The loggers below ``kmpc_lite`` are never
configured here; a program that wants to read them calls
``logging.basicConfig(level=logging.INFO)``. Each event is told once, not at every step.
"""

from __future__ import annotations

import logging
import math
import re

import numpy as np

from kmpc_lite.control.kernels.records import SPREAD_RATE
from kmpc_lite.control.limits import reached_speeds
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.plan import (
    NO_PROGRESS,
    UNSEEN,
    GoalProgress,
    Plan,
    PlannedAround,
    PlanStatus,
)
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.state import StandstillState
from kmpc_lite.model.arguments import speeds
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

logging.getLogger("kmpc_lite").addHandler(logging.NullHandler())
LOG = logging.getLogger("kmpc_lite.control")
NUMBERS = re.compile(r"\d+(\.\d+)?")
STANDS = np.array([0.15, 0.5])  # a robot that moves by less [m], and turns by less [rad], stands
STALLS = 2.0  # a robot stands for long after this many times the guide's `stall_time`
LITTLE = 0.1
"""Share of its fastest speed and turn rate below which a robot is hardly commanded to move."""


class Events:
    """Tells what is new; nothing is decided by it, so that it is no part of a drive's state."""

    def __init__(self) -> None:
        self._told = ""
        self._drifting = False

    def path(self, switched: bool) -> None:
        """Note whether the robot follows another path from now on."""
        if switched:
            LOG.info("path changed")

    def drift(self, drifting: bool) -> None:
        """Note whether the floor pushes the robot to one side."""
        if drifting != self._drifting:
            LOG.warning("drift: the floor pushes the robot") if drifting else LOG.info("drift over")
        self._drifting = drifting

    def refused(self, reason: str) -> None:
        """Note that a step could not be planned from what was measured."""
        self._tell(logging.WARNING, f"refused: {reason}")

    def planned(self, status: PlanStatus, progress: GoalProgress, reason: str) -> None:
        """Note how a plan came about."""
        if status in (PlanStatus.STOPPED, PlanStatus.FALLBACK):
            self._tell(logging.WARNING, f"stop: {reason}")
        elif progress in (GoalProgress.UNREACHABLE, GoalProgress.WAITING):
            self._tell(logging.WARNING, f"{progress.value}: {reason}")
        elif self._told:
            self._told = ""
            LOG.info("%s again", progress.value)

    def _tell(self, level: int, text: str) -> None:
        """Log what was not the last thing that was told, numbers aside."""
        kind = NUMBERS.sub("#", text)
        if kind != self._told and not (self._told.startswith("refused") and kind[:4] == "stop"):
            LOG.log(level, "%s", text)
            self._told = kind


class Answers:
    """Makes plans.

    `problem`: in metres and seconds. `scale`: the robot's units.
    """

    def __init__(self, problem: NavigationProblem, scale: Scale) -> None:
        self._problem, self._scale = problem, scale
        self.events = Events()  # told of every plan

    def jump(self, size: tuple[float, float]) -> str:
        """Say that a pose has jumped, by a distance in units and an angle [rad]."""
        distance, turn = self._scale.length * size[0], size[1]
        return f"the pose jumped by {distance:.2f} m, {turn:.2f} rad: waiting until poses agree"

    def plan(
        self,
        now: Now,
        states: Array,
        inputs: Array,
        status: PlanStatus,
        reason: str,
        progress: GoalProgress,
        *,
        pose_is_lost: bool = False,
    ) -> Plan:
        """Make a plan of states (N + 1, 3) and inputs (N, 2) in the robot's units."""
        scale, problem = self._scale, self._problem
        solids = None if pose_is_lost else now.solids
        # where the robot is not known, nor is its distance to anything
        circles = now.things[: 0 if pose_is_lost else None, :SPREAD_RATE]
        around = PlannedAround(
            circles * scale.circle,
            solids,
            problem.body_radius,
            problem.dt,
            scale.length,
            None if pose_is_lost or now.view is None else now.view.hits,
            problem.footprint,
        )
        commands = inputs * scale.command
        self.events.planned(status, progress, reason)
        return Plan(
            command=problem.within_bounds(commands[0]),
            states=states * scale.state,
            inputs=commands,
            status=status,
            iterations=now.passes,
            timing=now.clock.timing(),
            reason=reason,
            reachable=now.guidance is None or now.guidance.reachable,
            holding=progress is GoalProgress.HOLDING,
            progress=progress,
            around=around,
        )


class StandstillWatch:
    """Watches for a robot that stands."""

    def __init__(self, units: NavigationProblem, scale: Scale, options: GuidanceOptions) -> None:
        self._dt, self._scale = units.dt, scale
        self._longest = STALLS * options.stall_time
        self._little = LITTLE * np.abs(reached_speeds(units))

    def tell(
        self, now: Now, command: Array, reason: str, progress: GoalProgress
    ) -> tuple[str, GoalProgress]:
        """Give reason and progress, with why the robot has stood where it has stood for long.

        `now`: the step; its state is updated. `command`: (2,) of the coming period. `reason`: why
        it does not drive, by the guide. `progress`: what it does about its goal, by the guide.
        """
        # without guidance a robot at its goal is told to be driving
        state, here, aim = now.state.standstill, now.here.tolist(), tuple(now.goal.tolist())
        on_its_way = now.guidance is not None or math.dist(here[:2], aim[:2]) > STANDS.item(0)
        drives = progress is GoalProgress.DRIVING and on_its_way and not now.held
        # a robot that does not drive, but waits or holds, begins anew when it drives
        drives = drives or reason.startswith((NO_PROGRESS, UNSEEN))
        turned = abs(math.remainder(here[2] - state.place[2], math.tau))
        moved = np.array((math.dist(here[:2], state.place[:2]), turned))
        if not (drives and (moved <= STANDS).all() and aim == state.place[3:]):
            state.place, state.time, moved = (*here, *aim), 0.0, np.zeros(2)
            state.ways = np.zeros((2, 2))
        elif state.time > self._longest and (why := self._why(state)):
            return "; ".join(filter(None, (reason, why))), GoalProgress.WAITING
        state.time += self._dt
        asked, farthest = state.ways
        asked = asked + self._dt * np.abs(speeds(command))
        state.ways = np.stack([asked, np.fmax(farthest, moved)])
        return reason, progress

    def _why(self, state: StandstillState) -> str:
        """What a user can do about it; nothing of a robot that is slow."""
        asked, moved = state.ways
        way, turn = asked.tolist()
        seconds = state.time * self._scale.time
        stands = f"the robot has not moved for {seconds:.3g} s"
        by = f"by {way * self._scale.length:.2g} m and {turn:.2g} rad"
        # what turns round, or parks, in a small place moves by more
        if (asked > STANDS).any() and (3.0 * moved <= STANDS).all():
            return (
                f"{stands}, though it was commanded to, {by}: motors off, wheels blocked, or "
                "poses that do not change"
            )
        if (asked < state.time * self._little).all():
            return (
                f"{stands}: its commands would have moved it {by} only; its limits, its model, "
                "or what stands beside it allow no more"
            )
        return ""
