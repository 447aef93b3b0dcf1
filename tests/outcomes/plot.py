"""A drive as a picture: path, obstacles to scale, commands."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from kmpc_lab.report import picture
from kmpc_lab.report.style import render, write_picture
from outcomes.lab import World
from outcomes.loop import Trace, result_of
from outcomes.setup import Row


def draw(row: Row, trace: Trace, path: Path) -> None:
    """Write a PNG; what moves is drawn at the start, half way and at the end."""
    setup, found = trace.setup, result_of(row, trace)
    scene, problem = setup.scene, setup.problem
    ends = setup.dt * (len(trace.poses) - 1)
    moments = [World(scene.circles_at(share * ends)) for share in (0.0, 0.5, 1.0)]
    drawn = picture.Trace(
        np.array(trace.poses),
        np.array(trace.commands),
        tuple(status for status, _, _ in trace.plans),
        np.array(setup.goal_at(ends)),
        problem.footprint or problem.robot_radius,
        [scene.world, *moments],
        setup.dt,
    )
    title = (
        f"{row.family}: {row.name}\n{found.ended} {found.time:.2f} s, {found.contacts} contacts, "
        f"least clearance {found.clearance:.2f} r {found.faults}"
    )
    write_picture(path, render(picture.drive_picture({"": drawn}, title), "png"))
