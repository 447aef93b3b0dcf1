"""Options of sight: what is remembered, and what is assumed of what is out of sight."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, clock_seconds, count, radii, seconds, share, speed


@dataclass(frozen=True, slots=True)
class SightOptions:
    """How scans become a map of the robot's neighbourhood, and how long it is believed."""

    cell: float = radii(1 / 3, zero=False)
    """Side of a cell of the map [radii]; larger where the scanner is coarser."""
    cell_noise: float = share(2.0)
    """Least side of a cell, as a multiple of the standard deviation of the ranges."""
    map_reach: float = share(2.0, zero=False)
    """Distance to the map's edge from its middle, as a multiple of the scanner's reach, where the
    map does not hold the whole area."""
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
    level: float = share(1.0)
    """How far what was hit may stand out of a straight line and count as behind it, as a share of
    a cell: a wall is told by few half-planes, noise and all."""
    free_distance: float = radii(20.0)
    """How far from the scanner cells are noted as seen to be free [radii]; beyond, only what stood
    there before and is gone."""
    blocked_interval: float = seconds(0.2)
    """Time between two looks whether what was seen lately stands on the path [s]."""
    refresh_interval: float = seconds(3.0)
    """Longest time after which a path is looked for on the map as it is then [s]: what was in the
    way may have gone."""
    gear_time: float = seconds(2.0)
    """How much slower a path may be that needs no change of gear, to be taken [s]."""
    lattice_nodes: int = count(12_000)
    """Most nodes of the lattice on which paths are looked for: a search is a matter of
    milliseconds."""
    lattice_step: float = radii(0.5, zero=False)
    """Least distance between neighbours of that lattice [radii]."""
    free_at_start: float = radii(0.0)
    """How far from the robot's edge there is nothing where it begins, seen or not [radii]. One with
    corners, and a camera at its front edge, does not see what it must sweep to get away."""
    trail: int = count(64, least=2)
    """How many poses of the past are kept, to tell where old beams were sent from."""
    blind_time: float = clock_seconds(1.0)
    """How long the robot drives on while scans tell nothing new [s, by the clock: scanners have
    their own pace]; then it stops until they do."""
    same_scan_distance: float = radii(0.5)
    """How far the robot may have come, or its edge may have turned, since a scan that is told again
    [radii]; what is told again from farther away is what the scanner saw before."""
    emerging_speed: float = speed(0.0)
    """Speed at which somebody may step out of what the robot does not see now [m/s]; zero: nobody
    does."""

    def __post_init__(self) -> None:
        check(self)
