"""Whether the robot stands for long, and whether its commands would have moved it.

A robot that neither moves nor turns, whatever the cause, is never told to be driving: the guide may
see a path, the solver a solution, and the motors be off.
"""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.mobility import reached_speeds
from kmpc_lite.control.now import Now
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.plan import NO_PROGRESS, UNSEEN, GoalProgress
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.state import StandstillState
from kmpc_lite.model.arguments import speeds
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

STANDS = np.array([0.15, 0.5])
"""A robot that moves by less [m], and turns by less [rad], stands."""
STALLS = 2.0
"""A robot stands for long after this many times the guide's `stall_time`."""
LITTLE = 0.1
"""Share of its fastest speed and turn rate below which a robot is hardly commanded to move."""


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
        drives = progress is GoalProgress.DRIVING and on_its_way
        # a robot that does not drive, but waits or holds, begins anew when it drives
        drives = drives or reason.startswith((NO_PROGRESS, UNSEEN))
        moved, turned = math.dist(here[:2], state.place[:2]), here[2] - state.place[2]
        stays = moved <= STANDS.item(0) and abs(math.remainder(turned, math.tau)) <= STANDS.item(1)
        if not (drives and stays and aim == state.place[3:]):
            state.place, state.time, state.asked = (*here, *aim), 0.0, np.zeros(2)
        elif state.time > self._longest and (why := self._why(state)):
            return "; ".join(filter(None, (reason, why))), GoalProgress.WAITING
        state.time += self._dt
        state.asked = state.asked + self._dt * np.abs(speeds(command))
        return reason, progress

    def _why(self, state: StandstillState) -> str:
        """What a user can do about it; nothing of a robot that is slow."""
        way, turn = state.asked.tolist()
        seconds = state.time * self._scale.time
        stands = f"the robot has not moved for {seconds:.3g} s"
        asked = f"by {way * self._scale.length:.2g} m and {turn:.2g} rad"
        if (state.asked > STANDS).any():
            return (
                f"{stands}, though it was commanded to, {asked}: motors off, wheels blocked, or "
                "poses that do not change"
            )
        if (state.asked < state.time * self._little).all():
            return (
                f"{stands}: its commands would have moved it {asked} only; its limits, its model, "
                "or what stands beside it allow no more"
            )
        return ""
