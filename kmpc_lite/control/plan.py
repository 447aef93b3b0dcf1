"""What the controller answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property

from kmpc_lite.types import Array


class PlanStatus(Enum):
    """How a plan came about."""

    SOLVED = "solved"
    """The QP was solved to its tolerance and the plan passed its checks."""
    FEASIBLE = "feasible"
    """The solver was stopped early; what it had passed the checks."""
    FALLBACK = "fallback"
    """No usable solution: the rest of the last good plan is driven."""
    STOPPED = "stopped"
    """No usable plan: the robot brakes, and then stands."""


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
    measure_clearance: Callable[[], float] = field(repr=False)
    """Works out `clearance`: only for those who ask, a step does not wait for it."""
    iterations: int
    """SQP passes."""
    timing: Mapping[str, float]
    """Seconds by phase, and ``total``."""
    reason: str = ""
    """Why the status is not SOLVED, in words."""
    reachable: bool = True
    """Whether there is a way to the goal, as far as guidance can tell; where there is none the
    robot waits at a safe place."""
    holding: bool = False
    """Whether the robot has parked at its goal and stands there."""

    @cached_property
    def clearance(self) -> float:
        """Smallest distance from the robot's edge to an obstacle's along `states` [m]; infinite without obstacles."""
        return self.measure_clearance()
