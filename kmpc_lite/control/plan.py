"""What a step is planned from, for and among; what it answers, and what that is worth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.kernels.records import distances, things_of
from kmpc_lite.control.margins import FeltNoise, Margins
from kmpc_lite.control.world.scene import Surroundings
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array

if TYPE_CHECKING:
    from kmpc_lite.control.footprint import Footprint
    from kmpc_lite.control.world.solids import Nearby, Solids

NO_REFERENCE = np.empty((0, STATES))  # of a task that nothing is planned for


class Task(NamedTuple):
    """What a robot starts from in a step, what it steers for, and what it must be clear of."""

    model: MotionModel  # predicts; its number of past commands is the QP's
    past: Array  # (L, 2) commands already sent, oldest first
    last: Array  # (2,) the command sent last, zero of a robot that stands
    around: Surroundings  # what is around the robot
    margins: Margins | None = None  # beyond the radii; without them no plan is refused
    felt: FeltNoise | None = None  # the noise, as past innovations inflate it; given with `margins`
    reference: Array = NO_REFERENCE  # (N + 1, 3) states to steer for
    to_goal: bool = False  # whether that is the goal itself, however far, at every stage
    path_clearance: float | Array = math.inf
    """What the path keeps from obstacles beyond the problem's margin [m], or at each stage,
    (N, 1)."""
    late: int = 0  # stages of the reference to which commands lead that were sent before
    curvature: float = 0.0  # in which the wheels of a car stand now [1/m]
    terminal_share: float = 1.0  # part of the terminal weight that counts
    rolls_on: Array | None = None
    """(3,) by how much farther it comes than its model says; none if it answers as that says."""
    deadline: float = math.inf  # when a plan must be there, on the clock of the SQP [s]


NO_PROGRESS = "no progress, on this path and on another one"
UNSEEN = "no progress: what stands beside the robot was never seen (sight.free_at_start)"
"""Reasons of plans of robots that do not get nearer to their goals."""


class PlanStatus(Enum):
    """How a plan came about."""

    SOLVED = "solved"
    """The QP was solved to its tolerance and the plan passed its checks."""
    FEASIBLE = "feasible"
    """The plan passed its checks, but the solver was stopped early or did not converge, or the
    plan's states contradicted the model and were rolled out anew."""
    FALLBACK = "fallback"
    """No usable solution: the stop trajectory of the last good plan is driven."""
    STOPPED = "stopped"
    """No usable plan: the robot brakes, and then stands."""


class GoalProgress(Enum):
    """What the robot is doing about its goal."""

    DRIVING = "driving"
    """On its path, or making room for something that moves."""
    HOLDING = "holding"
    """Parked at the goal, as closely as it can be."""
    UNREACHABLE = "unreachable"
    """No path leads to the goal; the robot waits at a safe place. `Plan.reason` says why."""
    WAITING = "waiting"
    """Standing, though a path is there or is being looked for. `Plan.reason` says for what."""


class PlannedAround(NamedTuple):
    """The obstacles that a plan was made for."""

    circles: Array  # (M, 5) rows x, y, radius [m], vx, vy [m/s], at the plan's beginning
    solids: Solids | None  # polygons, walls and grids, in units of `unit`
    radius: float  # of the robot [m]
    dt: float  # period of the plan [s]
    unit: float = 1.0  # metres of one unit in which the solids are told
    hits: Nearby | None = None  # what scans have hit near the robot, in the same units
    footprint: Footprint | None = None
    """Of a robot that is not round; `radius` is then that of the circles that cover it."""

    def clearances(self, states: Array) -> Array:
        """Distances (K,) between the edges of robot and obstacles at states (K, 3) [m]."""
        # here, for a plan is imported before obstacles are
        from kmpc_lite.control.footprint import places_of

        places, count = places_of(self.footprint, states), len(states)
        each = len(places) // max(count, 1)
        times = np.repeat(self.dt * np.arange(count), each)
        least = np.full(len(places), np.inf)
        if len(self.circles):
            least = distances(things_of(self.circles), places, times).min(axis=1)
        if self.solids is not None:
            least = np.minimum(least, self.unit * self.solids.whole.least(places / self.unit))
        if self.hits is not None:
            least = np.minimum(least, self.unit * self.hits.least(places / self.unit))
        out: Array = least.reshape(count, max(each, 1)).min(axis=1) - self.radius
        return out

    def clearance(self, states: Array) -> float:
        """Smallest of the `clearances` [m]."""
        return float(self.clearances(states).min())


NOTHING_AROUND = PlannedAround(np.empty((0, 5)), None, 0.0, 1.0)  # no obstacles


@dataclass(frozen=True, eq=False)
class Plan:
    """A command that is safe to send, and where it leads."""

    command: Array
    """(2,) v [m/s], omega [rad/s]: always finite, always within bounds."""
    states: Array
    """(N + 1, 3) predicted states; the first is the present one."""
    inputs: Array
    """(N, 2) planned commands; the first is `command`."""
    status: PlanStatus
    """How the plan came about."""
    iterations: int
    """SQP passes."""
    timing: Mapping[str, float]
    """Seconds by phase, and ``total``."""
    reason: str = ""
    """Why the status is not SOLVED, or the progress not DRIVING or HOLDING, in words."""
    reachable: bool = True
    """Whether there is a path to the goal, as far as guidance can tell; if there is none the
    robot waits at a safe place."""
    holding: bool = False
    """Whether the robot has parked at its goal and stands there."""
    progress: GoalProgress = GoalProgress.DRIVING
    """What the robot is doing about its goal."""
    leg: tuple[int, int] = (1, 1)
    """Which goal of a route it leads to, from 1, and of how many: noted by what gives the goals."""
    around: PlannedAround = field(default_factory=lambda: NOTHING_AROUND, repr=False)
    """The obstacles that it was made for."""

    @cached_property
    def clearance(self) -> float:
        """Smallest distance from the robot's edge to an obstacle's along `states` [m].

        Infinite without obstacles. Worked out when it is asked for: a step does not wait for it.
        """
        return self.around.clearance(self.states)
