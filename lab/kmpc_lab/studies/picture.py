"""The worst drive of a study as a picture: its way, the robot to scale, its commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill

from kmpc_lab.report.picture import drive_picture
from kmpc_lab.report.style import render, write_picture
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.study import Asked, Study, drive_traced


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
