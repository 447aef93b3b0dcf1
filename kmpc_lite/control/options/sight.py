"""Options of sight: how much is looked at, what is remembered of it, and what counts as moving."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import (
    check,
    clock_seconds,
    count,
    probability,
    radii,
    seconds,
    share,
    speed,
)


@dataclass(frozen=True, slots=True)
class ObstacleOptions:
    """Largest obstacles, and most of them: more would take seconds, or more memory than there is.

    Polygons and grids are held to them where they are made, all obstacles together in each step,
    which stops the robot where they are too many.
    """

    circles: int = count(1500)
    """Circles of one step."""
    edges: int = count(2000)
    """Edges of all polygons and walls of one step; each polygon counts as the one with the most."""
    polygon_corners: int = count(100)
    """Corners of one polygon."""
    grid_cells: int = count(2**24)
    """Cells of one grid, and of all of one step."""
    grid_runs: int = count(50_000)
    """Runs of occupied cells, along rows or columns as these are fewer, of one grid and of all of
    one step: noise has many, walls have few."""
    scan_beams: int = count(2**14)
    """Beams of one scan."""

    def __post_init__(self) -> None:
        check(self)


USUAL_OBSTACLES = ObstacleOptions()
"""What polygons and grids are held to if nothing else is asked for."""


@dataclass(frozen=True, slots=True)
class SightOptions:
    """How scans become a map of the robot's neighbourhood, and how long it is believed."""

    cell: float = radii(1 / 3, zero=False)
    """Side of a cell of the map [radii]; larger where the scanner is coarser."""
    most_cells: int = count(400, least=20)
    """Most cells along a side of the map: what is farther away is not remembered."""
    memory: float = seconds(120.0, zero=False)
    """How long what is out of sight is remembered [s]: then nothing is known there. Scans, and
    circles that are out of `sensor_range`."""
    passes: int = count(3, most=127)
    """How many scans must pass through a cell that was hit until it counts as free."""
    certainty: float = share(2.0)
    """How many standard deviations of range and pose a surface is taken to be nearer than it was
    seen: a range counts with its neighbours on the same surface."""
    free_at_start: float = radii(0.0)
    """How far from the robot's edge there is nothing where it begins, seen or not [radii]. One with
    corners, and a camera at its front edge, does not see what it must sweep to get away."""
    blind_time: float = clock_seconds(1.0)
    """How long the robot drives on while scans tell nothing new [s, by the clock: scanners have
    their own pace]; then it stops until they do."""
    emerging_speed: float = speed(0.0)
    """Speed at which a pedestrian may step out of what the robot does not see now [m/s]; zero:
    none does."""

    def __post_init__(self) -> None:
        check(self)


@dataclass(frozen=True, slots=True)
class TrackerOptions:
    """What is believed of sensors that see circles, and of what walks.

    Times are the robot's in a controller, and by the clock in an `ObstacleTracker`, which knows of
    no robot.
    """

    noise: float = radii(2 / 15, zero=False)
    """Standard deviation of a seen position along each axis [radii]: 2 cm for a radius of 15 cm, as
    of a leg that a lidar sees one side of."""
    acceleration: float = share(2 / 3, zero=False)
    """Standard deviation of accelerations along each axis, in the robot's fastest speeds a
    second."""
    false_alarm: float = probability(1e-3)
    """Probability that a circle which keeps its velocity is taken for one that does not."""
    coast: float = seconds(1.5)
    """How long a track lasts unseen [s], and at most as long as it was seen."""
    spread: float = share(3.0)
    """Standard deviations of its velocity by which a circle that was seen to move grows, up to the
    robot's radius: whether a pedestrian comes or not must not block the way."""

    begins: float = seconds(0.85)
    """How long a cluster must have left the place where it was to be a pedestrian [s]; a third of
    it where it comes to what was seen to be free."""

    def __post_init__(self) -> None:
        check(self)
