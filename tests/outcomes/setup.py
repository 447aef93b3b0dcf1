"""What one drive consists of before it is driven."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Protocol

import numpy as np

import kmpc_lite as kl
from outcomes.lab import Scenario, World, world_of
from outcomes.plant import Array, Moves

NO_CIRCLES = np.empty((0, 5))
Clock = Callable[[], float]


class Movers(Protocol):
    """Circles that do not follow straight lines."""

    def at(self, time: float) -> Array:
        """Rows x, y, radius, vx, vy (M, 5) at a time [s]."""


@dataclass
class Scene:
    """Obstacles as they are."""

    bounds: tuple[float, float, float, float]  # xmin, ymin, xmax, ymax [m]
    circles: Array = field(default_factory=lambda: NO_CIRCLES)
    """Rows x, y, radius, vx, vy (M, 5) at time 0."""
    solids: tuple[Any, ...] = ()  # polygons, walls and a grid
    movers: Movers | None = None
    visits: tuple[tuple[float, float, tuple[float, ...]], ...] = ()
    """From when until when [s] a circle, a row as of time 0, is there."""
    edges: Array | None = None
    """Edges (S, 4) beside the solids: worlds that are seen by scanners alone."""

    @cached_property
    def world(self) -> World:
        """Edges and rounded ends of the solids, for rays and distances."""
        kinds: dict[type, list[Any]] = {kl.Polygon: [], kl.Wall: [], kl.OccupancyGrid: []}
        for solid in self.solids:
            kinds[type(solid)].append(solid)
        low, high = np.array(self.bounds[:2]), np.array(self.bounds[2:])
        grids = kinds[kl.OccupancyGrid]
        scenario = Scenario(
            "scene",
            (*(low - 1e3).tolist(), *(high + 1e3).tolist()),
            (),
            1e-6,
            (*(low - 900.0).tolist(), 0.0),
            (*(low - 800.0).tolist(), 0.0),
            polygons=tuple(kinds[kl.Polygon]),
            walls=tuple(kinds[kl.Wall]),
            grid=grids[0] if grids else None,
        )
        solid = world_of(scenario)
        edges = solid.edges if self.edges is None else np.vstack([solid.edges, self.edges])
        return World(solid.circles, edges)

    def circles_at(self, time: float) -> Array:
        """Rows of all circles (M, 5) at a time [s]."""
        rows = [self.circles, *([self.movers.at(time)] if self.movers is not None else [])]
        visitors = [row for begin, end, row in self.visits if begin <= time < end]
        rows[0] = np.vstack([self.circles, *(np.array([row]) for row in visitors)])
        moved = rows[0].copy()
        moved[:, :2] += time * moved[:, 3:]
        return np.vstack([moved, *rows[1:]])

    def world_at(self, time: float) -> World:
        """What rays meet at a time [s]."""
        return World(np.vstack([self.world.circles, self.circles_at(time)]), self.world.edges)


@dataclass
class Moment:
    """What a sensor is asked with: the moment at which the robot looks."""

    time: float
    number: int  # of the step
    pose: Array  # true pose (3,)
    scene: Scene
    radius: float
    random: np.random.Generator


Sense = Callable[[Moment], Any]
Pose = Callable[[int, Array], Array]


@dataclass
class Setup:
    """One drive."""

    scene: Scene
    start: Array
    goal: Array
    problem: kl.NavigationProblem
    model: kl.KoopmanModel
    plant: Moves
    sense: Sense  # gives the obstacles of a step
    options: dict[str, Any] = field(default_factory=dict)  # keyword arguments of the controller
    noise: tuple[float, float] = (0.0, 0.0)  # standard deviation of measured poses [m, rad]
    pose_age: float = 0.0  # how old a measured pose is [s]
    measure: Pose | None = None
    """Makes the measured pose of a step from the right one: jumps, losses."""
    frame: Callable[[], Array] | None = None
    """By how much the frame of poses and obstacles has moved (3,)."""
    kicks: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    """Steps before which the robot is carried by so much, in the map's frame."""
    goals: tuple[tuple[float, Array], ...] = ()  # times [s] from which on there is another goal
    gate: tuple[float, float] | None = None
    """Acceleration limits between controller and robot; what they leave is given as `sent`."""
    before: Callable[[int, kl.Controller], kl.Controller | None] | None = None
    """Called before each step: switches faults; a controller that it returns drives on."""
    tolerance: tuple[float, float] | None = None
    """What counts as arrived [m, rad]; a tenth of the radius and 0.1 rad if not given."""
    limit: float = 60.0  # longest time [s]
    least: float = 0.0  # shortest time [s]: what is still to come is waited for
    stays: bool = False  # whether the drive goes on after the arrival until `limit`

    @property
    def dt(self) -> float:
        """Period [s]."""
        return self.problem.dt

    def goal_at(self, time: float) -> Array:
        """Goal (3,) at a time [s]."""
        goal = self.goal
        for begin, other in self.goals:
            if time >= begin - 1e-9:
                goal = other
        return goal


Make = Callable[[int], "Setup | None"]


@dataclass(frozen=True)
class Row:
    """A drive by its name."""

    name: str  # says what happened
    family: str
    make: Make  # from a seed: 0 is the recorded drive; None if data is missing
    quick: bool = False  # whether it is among those of ``make test``
    right: str = "arrived"
    """How it should end, or ways to end joined by slashes: anything else is a known failure."""
    touches: bool = False  # whether the robot begins in contact, or is run into while it stands
    chatter: float = 0.15
    """Largest share of steps in which a command may jump back, where poses are sound."""


def area(bounds: Sequence[float]) -> dict[str, tuple[float, float, float]]:
    """`x_min` and `x_max` of a problem in an area."""
    return {"x_min": (bounds[0], bounds[1], -np.inf), "x_max": (bounds[2], bounds[3], np.inf)}
