"""A drive as a picture: path, obstacles to scale, statuses by colour."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from outcomes.loop import Trace, result_of
from outcomes.setup import Row

COLOURS = {"SOLVED": "tab:green", "FEASIBLE": "gold", "FALLBACK": "tab:orange", "STOPPED": "red"}


def draw(row: Row, trace: Trace, path: Path) -> None:
    """Write a PNG."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot
    from matplotlib.patches import Circle, Polygon

    setup, scene = trace.setup, trace.setup.scene
    figure, (axes, lower) = pyplot.subplots(2, 1, figsize=(8, 11), height_ratios=(4, 1))
    poses = np.array(trace.poses)
    ends = setup.dt * (len(poses) - 1)
    for share in (0.0, 0.5, 1.0):
        for x, y, radius, vx, vy in scene.circles_at(share * ends).tolist():
            alpha = 0.25 + 0.5 * share if (vx or vy or scene.movers) else 0.25
            axes.add_patch(Circle((x, y), radius, color="gray", alpha=alpha, lw=0))
    for x, y, radius in scene.world.circles[:, :3].tolist():
        axes.add_patch(Circle((x, y), radius, color="gray", alpha=0.5, lw=0))
    for x1, y1, x2, y2 in scene.world.edges.tolist():
        axes.plot((x1, x2), (y1, y2), color="black", lw=1.0)
    for pose in poses[:: max(len(poses) // 25, 1)]:
        if setup.problem.footprint is not None:
            corners = setup.problem.footprint.at(pose)
            axes.add_patch(Polygon(corners, fill=False, color="tab:blue", alpha=0.4))
        else:
            axes.add_patch(
                Circle(
                    pose[:2], setup.problem.robot_radius, fill=False, color="tab:blue", alpha=0.4
                )
            )
    statuses = [status for status, _, _ in trace.plans]
    for status, colour in COLOURS.items():
        at = [k for k, found in enumerate(statuses) if found == status]
        axes.scatter(*poses[at, :2].T, s=8, color=colour, label=f"{status} {len(at)}", zorder=3)
    goal = setup.goal_at(ends)
    for pose, colour in ((poses[0], "tab:blue"), (goal, "tab:red")):
        size = 2.0 * setup.problem.robot_radius
        turned = size * np.cos(pose[2]), size * np.sin(pose[2])
        axes.annotate(
            "", pose[:2] + turned, pose[:2], arrowprops={"arrowstyle": "->", "color": colour}
        )
    axes.set_aspect("equal")
    axes.legend(loc="upper left", fontsize=8)
    found = result_of(row, trace)
    axes.set_title(
        f"{row.family}: {row.name}\n{found.ended} {found.time:.2f} s, {found.contacts} contacts, "
        f"least clearance {found.clearance:.2f} r {found.faults}",
        fontsize=9,
    )
    commands = np.array(trace.commands)
    times = setup.dt * np.arange(len(commands))
    lower.step(times, commands[:, 0], where="post", label="v [m/s]")
    lower.step(times, commands[:, 1], where="post", label="omega [rad/s]")
    lower.legend(fontsize=8)
    lower.set_xlabel("time [s]")
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    pyplot.close(figure)
