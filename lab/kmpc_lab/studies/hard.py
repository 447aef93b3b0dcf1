"""Study ``hard``: rows of other studies in which a person would drive better, and what is asked."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from kmpc_lab.studies import clutter, limits, omni_gaps, parking, pedestrians
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.table import DRIVES, FEASIBLE, GAP, JERK, LOST, TIME, Column, Rows, table

FAST, SLOW = "3 m/s, 1 m/s^2, 3 rad/s^2", "1 m/s, 0.5 m/s^2, 1.5 rad/s^2"
SCORE = "all in pose; 0.498 or more; none longer than twice DWA's time"
FEW = "95 % in pose; at most 5 changes of gear in 90 %"


class Hard(NamedTuple):
    """A row."""

    drive: Callable[..., DriveResult]
    asked: tuple[str | float, ...]  # what is driven, beside the seed
    wanted: str  # what a driver would do


ROWS = {
    "3 m/s, given": Hard(limits.drive, (FAST, "given", 0.0), "1.15; lost 1 %; FEASIBLE 10 %"),
    "3 m/s, learned": Hard(limits.drive, (FAST, "learned", 0.0), "1.2; lost 1 %; FEASIBLE 10 %"),
    "3 m/s, by sight of 2 m": Hard(limits.drive, (FAST, "given", 2.0), "1.4; lost 1 %"),
    "0.5 m/s^2, untold": Hard(limits.drive, (SLOW, "untold", 0.0), "1.6; lost 2 %"),
    "clutter, exact": Hard(clutter.drive, ("field", "exact", "ours"), SCORE),
    "clutter, noisy": Hard(clutter.drive, ("field", "noisy", "ours"), SCORE),
    "clutter, late": Hard(clutter.drive, ("field", "late", "ours"), "all in pose; 0.495 or more"),
    "clutter, by DWA": Hard(clutter.drive, ("field", "exact", "dwa"), "to compare with"),
    "gap of 1.5 lengths": Hard(parking.drive, ("gap 1.5",), FEW),
    "gap of 1.35 lengths": Hard(parking.drive, ("gap 1.35",), FEW),
    "cars into bays": Hard(parking.drive, ("bay",), FEW),
    "cars that turn in a lane": Hard(parking.drive, ("lane",), "95 % in pose"),
    "cars in the open": Hard(parking.drive, ("open",), "1.3"),
    "cars that only drive ahead": Hard(parking.drive, ("open, forward only",), "all in pose"),
    "cars that steer slowly": Hard(parking.drive, ("open, slow steering",), "all in pose"),
    "omnis sideways into a slot": Hard(omni_gaps.drive, ("sideways",), "all in pose"),
    "omnis through a door": Hard(omni_gaps.drive, ("door",), "all in pose"),
    "8 pedestrians, told": Hard(pedestrians.drive, (8, "straight", "told"), "1 in 20 is met"),
    "8 pedestrians, lidar": Hard(pedestrians.drive, (8, "straight", "lidar"), "1 in 20 is met"),
}


def many_gears(rows: Rows) -> float:
    """Share of drives with more than five changes of gear."""
    return sum(row.gear_changes > 5 for row in rows) / len(rows)


def told(name: str) -> Callable[[Rows], float]:
    """Mean of what a study tells more; NaN for the others."""
    return lambda rows: sum(row.more.get(name, float("nan")) for row in rows) / len(rows)


COLUMNS = (
    *DRIVES,
    TIME,
    LOST,
    FEASIBLE,
    Column("> 5 gears", ".0%", many_gears),
    JERK,
    Column("score", ".3f", told("score")),
    Column("met", ".2f", told("met")),
    GAP,
)


def drive(name: str, seed: int) -> DriveResult:
    """Drive a course of a row."""
    return ROWS[name].drive(*ROWS[name].asked, seed)


def render(rows: Rows) -> str:
    """Table, and what is asked of its rows."""
    names = dict.fromkeys(row.axes[0] for row in rows)
    asked = [f"asked of {name}: {ROWS[name].wanted}" for name in names]
    return "\n".join([table(rows, COLUMNS, "course"), *asked])
