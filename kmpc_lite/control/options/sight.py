"""Options of sight: what is remembered, and what is assumed of what is out of sight."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, clock_seconds, count, radii, seconds, share, speed


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
    """Speed at which somebody may step out of what the robot does not see now [m/s]; zero: nobody
    does."""

    def __post_init__(self) -> None:
        check(self)
