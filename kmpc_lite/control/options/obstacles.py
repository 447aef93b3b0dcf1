"""How much of the world a step looks at."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, count


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
"""What polygons and grids are held to where nothing else is asked for."""
