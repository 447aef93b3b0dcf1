"""The worst drive of a study as a picture: its way, the robot to scale, its commands."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from kmpc_lab.studies.drive import DriveResult, Trace
from kmpc_lab.studies.study import Asked, Study, drive_traced
from kmpc_lite.control import Footprint, Polygon, Wall
from kmpc_lite.scenario.world import World

COLOURS = {"SOLVED": "tab:green", "FEASIBLE": "gold", "FALLBACK": "tab:orange", "STOPPED": "red"}
UNITS = "m/s", "m/s", "rad/s"


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
    draw(row.trace, f"{course}\n{ended}; {figures}, least gap {row.clearance:.3f} m", path)


def draw(trace: Trace, title: str, path: Path) -> None:
    """Draw a drive over its commands, into a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (axes, lower) = pyplot.subplots(2, 1, figsize=(8, 11), height_ratios=(4, 1))
    for thing in trace.around:
        _draw_thing(axes, thing)
    for k in range(0, len(trace.poses), max(len(trace.poses) // 30, 1)):
        _draw_body(axes, trace.body, trace.poses[k], "tab:blue")
    _draw_body(axes, trace.body, trace.goal, "tab:red")
    for status, colour in COLOURS.items():
        at = [k for k, found in enumerate(trace.statuses) if found == status]
        label = f"{status} {len(at)}"
        axes.scatter(*trace.poses[at, :2].T, s=8, color=colour, label=label, zorder=3)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.legend(loc="upper left", fontsize=8)
    axes.set_title(title, fontsize=9)
    times = trace.dt * np.arange(len(trace.commands))
    columns = trace.commands.T
    names = ("v", "omega") if len(columns) == 2 else ("v_x", "v_y", "omega")
    for name, unit, column in zip(names, UNITS[-len(names) :], columns, strict=True):
        lower.step(times, column, where="post", label=f"{name} [{unit}]", lw=0.8)
    lower.legend(fontsize=8)
    lower.set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)


def _draw_thing(axes: Any, thing: Any) -> None:
    """Draw an obstacle, or a world of them."""
    from matplotlib import patches

    if isinstance(thing, World):
        for x, y, radius in thing.circles[:, :3].tolist():
            axes.add_patch(patches.Circle((x, y), radius, color="gray", alpha=0.5, lw=0))
        for x1, y1, x2, y2 in thing.edges.tolist():
            axes.plot((x1, x2), (y1, y2), color="black", lw=1.0)
    elif isinstance(thing, Polygon):
        axes.add_patch(patches.Polygon(thing.vertices, color="gray", alpha=0.5, lw=0))
    elif isinstance(thing, Wall):
        axes.plot((thing.x1, thing.x2), (thing.y1, thing.y2), color="black", lw=1.0)
    else:
        _draw_thing(axes, World([tuple(thing)]))


def _draw_body(axes: Any, body: Footprint | float, pose: Any, colour: str) -> None:
    """Draw what a robot covers at a pose (3,), and its nose."""
    from matplotlib import patches

    if isinstance(body, Footprint):
        shape: Any = patches.Polygon(body.at(pose), fill=False, color=colour, alpha=0.4)
        size = body.radius
    else:
        shape, size = patches.Circle(pose[:2], body, fill=False, color=colour, alpha=0.4), body
    axes.add_patch(shape)
    ahead = pose[:2] + size * np.array((np.cos(pose[2]), np.sin(pose[2])))
    axes.plot(*np.transpose((pose[:2], ahead)), color=colour, alpha=0.4, lw=0.8)
