"""A study's drives as a table for people, and the worst of them as a picture."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import NamedTuple

import numpy as np
from scipy.stats import binomtest

from kmpc_lab.report.picture import drive_picture
from kmpc_lab.report.style import render, write_picture
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.study import Asked, Study, drive_traced

Rows = Sequence[DriveResult]


class Column(NamedTuple):
    """A column of a table."""

    title: str
    format: str  # of its numbers: ``.2f``
    of: Callable[[Rows], float]  # its number for the drives of a row


def count_of(name: str) -> Callable[[Rows], float]:
    """How many drives have something."""
    return lambda rows: sum(getattr(row, name) for row in rows)


def mean_of(name: str) -> Callable[[Rows], float]:
    """What drives have in the mean."""
    return lambda rows: float(np.mean([_value(row, name) for row in rows]))


def least_of(name: str) -> Callable[[Rows], float]:
    """What the drive has that has least."""
    return lambda rows: min(_value(row, name) for row in rows)


def median_of(name: str) -> Callable[[Rows], float]:
    """What those in pose have in the median."""

    def median(rows: Rows) -> float:
        values = [_value(row, name) for row in rows if row.arrived]
        return float(np.median(values)) if values else math.nan

    return median


def _value(row: DriveResult, name: str) -> float:
    return float(row.more[name] if name in row.more else getattr(row, name))


def time_to_ideal(rows: Rows) -> float:
    """Median of the times of those in pose, as multiples of ideal ones."""
    times = [row.seconds / row.ideal_seconds for row in rows if row.arrived]
    return float(np.median(times)) if times else math.nan


def at_least(rows: Rows) -> float:
    """Share of drives in pose that is exceeded with 97.5 %, after Wilson."""
    found = binomtest(sum(row.arrived for row in rows), len(rows))
    return float(found.proportion_ci(method="wilson").low)


DRIVES = (
    Column("drives", "d", len),
    Column("in pose", "d", count_of("arrived")),
    Column("collisions", "d", count_of("collided")),
)
AT_LEAST = Column("at least", ".1%", at_least)
TIME = Column("time to ideal", ".2f", time_to_ideal)
SECONDS = Column("time [s]", ".2f", median_of("seconds"))
STOPPED = Column("stopped", ".1%", mean_of("stopped"))
LOST = Column(
    "FALLBACK, STOPPED", ".1%", lambda rows: mean_of("fallback")(rows) + mean_of("stopped")(rows)
)
FEASIBLE = Column("FEASIBLE", ".1%", mean_of("feasible"))
JERK = Column("jerk", ".3f", mean_of("jerk"))
GAP = Column("least gap [m]", ".3f", least_of("clearance"))


def beside(rows: Rows, axis: int, value: str) -> Column:
    """Column of the times beside those that another value of an axis takes on the same courses."""

    def course(row: DriveResult) -> tuple[object, ...]:
        return *row.axes[:axis], *row.axes[axis + 1 :], row.seed

    theirs = {course(row): row.seconds for row in rows if row.axes[axis] == value and row.arrived}

    def ratio(some: Rows) -> float:
        both = [
            (row.seconds, theirs[course(row)])
            for row in some
            if row.arrived and course(row) in theirs
        ]
        return float(np.median([ours / other for ours, other in both])) if both else math.nan

    return Column(f"time to {value}", ".2f", ratio)


def table(rows: Rows, columns: Sequence[Column], course: str) -> str:
    """Table with a line for each of the `axes`, then every drive that touched or did not arrive.

    `rows`, `columns`: drives, and what is told of those of a line. `course`: what a seed draws:
    ``map``.
    """
    lines = {axes: [row for row in rows if row.axes == axes] for axes in (r.axes for r in rows)}
    if len(lines) > 1:
        lines["all", *[""] * (len(rows[0].axes) - 1)] = list(rows)
    widths = [max(map(len, words)) for words in zip(*lines, strict=True)]
    told = [[f"{column.of(some):{column.format}}" for column in columns] for some in lines.values()]
    sizes = [
        max(len(column.title), *map(len, numbers))
        for column, numbers in zip(columns, zip(*told, strict=True), strict=True)
    ]

    def line(words: Sequence[str], numbers: Sequence[str]) -> str:
        named = (f"{word:{width}}" for word, width in zip(words, widths, strict=True))
        return "  ".join([*named, *(f"{n:>{s}}" for n, s in zip(numbers, sizes, strict=True))])

    bad = [row for row in rows if not row.peer and (row.collided or not row.arrived)]
    return "\n".join(
        [
            line([""] * len(widths), [column.title for column in columns]),
            *map(line, lines, told),
            *(
                f"{', '.join(row.axes)}, {course} {row.seed}: "
                f"{'touched' if row.collided else row.ended or 'out of time'}"
                for row in bad
            ),
        ]
    )


def badness(row: DriveResult) -> tuple[bool, bool, float]:
    """Touched, then not in pose, then longest beside its ideal time."""
    return row.collided, not row.arrived, row.seconds / max(row.ideal_seconds, 1e-9)


def draw_worst(study: Study, rows: Mapping[Asked, DriveResult], path: Path) -> None:
    """Drive the worst row of ours again, and write its picture."""
    ours = {asked: row for asked, row in rows.items() if not row.peer} or rows
    row = drive_traced(study, max(ours, key=lambda asked: badness(ours[asked])))
    assert row.trace is not None
    course = f"{study.name}: {', '.join(row.axes)}, {study.course} {row.seed}"
    ended = "touched" if row.collided else "in pose" if row.arrived else fill(row.ended, 100)
    figures = f"{row.seconds:.1f} s, ideal {row.ideal_seconds:.1f} s"
    title = f"{course}\n{ended}; {figures}, least gap {row.clearance:.3f} m"
    write_picture(path, render(drive_picture({"": row.trace}, title), "png"))
