"""A search for a path that is under way, as data: it copies and pickles."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum, auto

from kmpc_lite.control.path.lattice_path import LatticePath
from kmpc_lite.control.path.path_map import PathMap
from kmpc_lite.control.path.tangent_graph import GeometricPath
from kmpc_lite.control.path.tangent_search import TangentSearch
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.types import Array


class Stage(Enum):
    """What the next part of a search is."""

    OBSTACLES = auto()
    """Gather the obstacles, and begin with the widest clearance."""
    LINKED = auto()
    """Search the lattice, whose nodes are linked."""
    STRAIGHTEN = auto()
    """Pull the lattice's path straight, if there is one."""
    LATTICE = auto()
    """Take over the lattice's path, if there is one."""
    TANGENTS = auto()
    """Go on on the tangent graph."""
    CHOSEN = auto()
    """A path is chosen, or there is none; the guide takes it over."""


ON_LATTICE = Stage.OBSTACLES, Stage.LINKED, Stage.STRAIGHTEN
"""Where a search on a lattice that is made part by part does the most work."""


@dataclass(slots=True)
class SearchObstacles:
    """Circles, and corners of solids, as the search sees them."""

    centres: Array
    """(M, 2) [m]."""
    sizes: Array
    """(M,) radii, before they are inflated [m]."""
    edges: Array
    """(S, 2) pairs of corners."""
    landmarks: Array
    """(L, 2) a point in each obstacle [m]."""
    most: Array
    """(M,) how far each may be inflated so that start and goal stay outside [m]."""
    area: Array
    """(4,) xmin, ymin, xmax, ymax [m]; start and goal lie in it."""


@dataclass(slots=True)
class PathSearch:
    """A search that is under way; all for the turning centre."""

    pose: Array
    """Where the path begins (3,)."""
    goal: Array
    """Where it ends (3,)."""
    target: Array
    """The goal of the tracked pose (3,)."""
    circles: Array
    """(M, 5) where they are met."""
    path_map: PathMap | None
    """Solids, if there are any."""
    previous: TimedPath | None
    """The path whose sides are kept to; none if any side is as good."""
    same_goal: bool
    """Whether the path before led to this goal."""
    stuck: bool
    """Whether the robot has stood for too long."""
    lead: float = 0.0
    """How long after the search began the robot is to be where the path begins [s]."""
    work: int = 0
    """Parts that were done; a long one counts as all parts of a step."""
    stage: Stage = Stage.OBSTACLES
    obstacles: SearchObstacles | None = None
    centre: Array | None = None
    """Turning centre (2,) that it is made for; none: the tracked pose."""
    clearances: list[float] = field(default_factory=list)
    """Still to be tried [m]."""
    clearance: float = math.inf
    """The one that is tried [m]."""
    lattice_path: LatticePath | None = None
    tangents: TangentSearch | None = None
    best: GeometricPath | None = None
    """The quickest path so far."""
    path: GeometricPath | None = None
    """The path chosen; none: there is none."""
    reason: str = ""
    """Why there is none."""
    avoid: TimedPath | None = None
    """A path that has led nowhere: one on another side of some obstacle is preferred."""
    avoid_place: float = 0.0
    """Where on it the robot stood [s]."""
    narrow: bool = False
    """Whether the widest clearance is not tried: paths that keep it have led nowhere."""
    instead: GeometricPath | None = None
    """What is taken if there is no other: a path like the one to avoid ..."""
    instead_clearance: float = math.inf
    """... and its clearance [m]."""
    gear_time: float = 0.0
    """How much slower a path in the gear of the previous one may be to be taken [s]."""
    same_gear: GeometricPath | None = None
    """The quickest path so far in that gear."""
    goal_clearance: float = math.inf
    """What the goal leaves beyond the problem's margin [m]."""
    only_tells: str = ""
    """Why there is no path among what moves, where the search was made without that: only to tell
    whether it is what stands in the way; its path is not driven."""
    gave_up: bool = False
    """Whether more obstacles were in the way than a search takes."""
    switched: bool = True
    """Whether it leads around some obstacle on another side than the previous one."""

    def weight(self, most: int) -> int:
        """How many parts the next one counts as: long ones on a lattice as the most of a step."""
        if self.path_map is not None and self.path_map.later and self.stage in ON_LATTICE:
            return most
        if self.stage is Stage.TANGENTS and self.tangents is not None:
            return self.tangents.weight
        return 1
