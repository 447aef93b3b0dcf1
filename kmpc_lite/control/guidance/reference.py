"""What the guidance tells the controller in each step."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.control.plan import GoalProgress
from kmpc_lite.types import Array


@dataclass(frozen=True, eq=False, slots=True)
class Guidance:
    """Where to steer."""

    states: Array
    """(N + 1, 3) reference of the stages; headings next to the robot's."""
    reachable: bool
    """Whether there is a path to the goal."""
    hold: bool
    """Whether the robot is to stand still: it is at the goal, or at the pose in the area that is
    nearest to it."""
    path: Array
    """(K, 2) points of the path from where it was planned to the goal [m]; the place to wait where
    there is none."""
    time_left: float
    """Until the goal is reached [s]; infinite where it cannot be."""
    refreshed: bool
    """Whether a new path was found in this step, or that there is none."""
    switched: bool
    """Whether the new path goes another way around, so that a plan along the old one is no good
    start."""
    progress: GoalProgress
    """What the robot does about its goal."""
    reason: str
    """Why it neither drives there nor holds."""
    path_clearance: float
    """What the path keeps beyond the problem's margin [m]; less where a passage is narrow."""
