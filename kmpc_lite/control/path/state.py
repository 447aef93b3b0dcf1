"""What the guide remembers from step to step: plain data, which copies and pickles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.kernels.clearance import COLUMNS, VELOCITY
from kmpc_lite.control.path.planner import PathRequest, Route, distances_around
from kmpc_lite.control.path.progress import GoalCheckerState, ProgressState
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Solids


BLOCKED = "something that moves stands in the only way"
"""Why there is no path where there is one but for what moves."""


@dataclass(slots=True)
class Search:
    """A search for a path that is under way: what was asked, and how far it has come."""

    request: PathRequest
    """What the planner was asked."""
    same_goal: bool
    """Whether the path before led to this goal."""
    stuck: bool
    """Whether the robot has stood for too long."""
    lead: float
    """How long after the search began the robot is to be where the path begins [s]."""
    refusal: str = ""
    """Why the robot cannot stand at its goal; empty if it can, as nearly always."""
    goal_clearance: float = math.inf
    """What the goal leaves beyond the problem's margin [m]."""
    only_tells: str = ""
    """Why there is no path among what moves, where the search was made without that: only to tell
    whether it is what stands in the way; its path is not driven."""
    parts: int = 0
    """How often the planner has worked on it: a copy has it do so again."""
    quanta: int = 0
    """How much work that was."""


@dataclass(slots=True)
class GuideState:
    """The path, the search for another one, and what they were made for."""

    # the path
    path: TimedPath | None = None
    """What is followed."""
    place: float = 0.0
    """Where on it the robot is [s]."""
    leg: float = 0.0
    """When its gear has changed last [s]."""
    path_clearance: float = math.inf
    """Clearance beyond the problem's margin that it keeps [m]."""
    goal_clearance: float = math.inf
    """What the goal leaves beyond that margin [m]: less than the path keeps, between obstacles."""
    turning: bool = False
    """Whether the robot is on its last turn on the spot."""
    why_none: str = ""
    """Why there is no path."""
    waiting: Array | None = None
    """Pose (3,) at which the robot waits while there is no path."""
    evasive_arc: int = -1
    """Number of the arc on which it makes room for a moving obstacle; -1: none."""
    turning_centre: Array | None = None
    """Point (2,) that paths are made for, ahead and to the left of the tracked pose [m]; none: that
    pose."""

    looking: bool = False
    """Whether it stands and turns to where its way goes dark, until it has looked there."""
    tried: tuple[Route, ...] = ()
    """Paths on which time was lost, until the robot gets nearer to its goal."""
    stood: Array = field(default_factory=lambda: np.full(3, np.nan))
    """(3,) where the robot began to turn on the spot, and its heading in the last step."""
    turned: float = 0.0
    """How far it has turned there [rad]."""
    steering: bool = False
    """Whether it stands until its wheels are turned."""
    yielding: bool = False
    """Whether the robot drives more slowly, or elsewhere, for something that moves."""
    yielded: float = 0.0
    """How long it has stood for something that moves, less what it has driven since [s]."""

    # what the last search was begun for
    goal: Array = field(default_factory=lambda: np.full(3, np.nan))
    """(3,), of the tracked pose."""
    circles: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(M, 5)."""
    solids: Solids | None = None
    known_solids: Solids | None = None
    """The same, and what scans had shown when the search was begun."""
    coarseness: float = 0.0
    """How far these may stand out of what was hit [m]."""
    age: float = 0.0
    """Time since then [s]."""

    unwatched: float = 0.0
    """Time since what scans show was last looked at for what stands on the path [s]."""

    # the search that is under way
    search: Search | None = None
    urgent: bool = False
    """Whether its path is needed in this step: the old one is not for this map or goal."""
    search_time: float = 0.0
    """How long a search takes during which the robot drives on, as the last ones have shown [s]."""
    only_renews: bool = False
    """Whether nothing is wrong with the path: it is kept unless another is much quicker."""
    centre_moved: bool = False
    """Whether the turning centre has moved since the last search was begun."""

    # the checkers
    goal_checker: GoalCheckerState = field(default_factory=GoalCheckerState)
    progress: ProgressState = field(default_factory=ProgressState)

    def kept_on_the_way(self, states: Array, inflation: float) -> float | Array:
        """Clearance beyond the margin that stages 1 to N of states (N + 1, 3) keep [m].

        One number, or one of each stage, (N, 1): where the goal leaves less than the path keeps, no
        more than what is left there. A robot that is to keep more is driven away from a goal
        between obstacles, and swings about it.

        `states`: the reference, or a plan. `inflation`: the problem's [m].
        """
        kept, left = self.path_clearance, max(self.goal_clearance, 0.0)
        if left >= kept:
            return kept
        at_rest = self.circles[~self.circles[:, VELOCITY].any(axis=1)]
        points = states[1:, :2]
        around = distances_around(points, at_rest, self.known_solids, self.coarseness) - inflation
        out: Array = np.minimum(np.maximum(around, left), kept)[:, None]
        return out
