"""All rows by their names, in the order of their families."""

from __future__ import annotations

from outcomes.rows import controllers, goals, maps, mishaps, moving, reach, robots, sight, wheels
from outcomes.setup import Row

TABLES = (
    maps.TABLE,
    maps.SCENES,
    robots.SCALES,
    robots.KNOWN,
    robots.ANY,
    robots.RATES,
    robots.BOUNDS,
    robots.SHAPES,
    reach.RAMPS,
    reach.REVEALED,
    sight.LIDAR,
    sight.VIEW,
    sight.BARN,
    moving.MOVING,
    moving.PEOPLE,
    goals.PARK,
    goals.GOALS,
    goals.FAR,
    mishaps.LAG,
    mishaps.FLOOR,
    mishaps.POSE,
    controllers.SOLVER,
    controllers.STATE,
    controllers.PAPER,
    controllers.REAL,
    wheels.CARS,
    wheels.OMNIS,
)
ROWS: dict[str, Row] = {row.name: row for table in TABLES for row in table.rows}
if len(ROWS) != sum(len(table.rows) for table in TABLES):
    names = [row.name for table in TABLES for row in table.rows]
    raise ValueError(f"rows with one name: {sorted({n for n in names if names.count(n) > 1})}")
