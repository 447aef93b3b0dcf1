"""What the gallery's examples share: a picture of robots that drove past obstacles."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib import patches

import kmpc_lite as kl

COLOURS = ("#0072b2", "#d55e00")
GREEN, GREY = "#009e73", "#8a8a8a"
OUTLINES = 12
"""How many outlines show a robot along its way."""


def outline(footprint, radius, pose, **style):
    """Patch of a robot in a pose: a circle with a radius, or a footprint."""
    x, y, theta = pose
    if footprint is None:
        return patches.Circle((x, y), radius, **style)
    turn = np.array([[np.cos(theta), np.sin(theta)], [-np.sin(theta), np.cos(theta)]])
    return patches.Polygon(np.array(footprint.corners) @ turn + (x, y), **style)


def draw(name, problem, drives, obstacles, goals, notes=""):
    """Write ``out/gallery/NAME.png``: poses (T, 3) of each robot, obstacles and goals."""
    figure, axes = plt.subplots(figsize=(4.2, 3.4), dpi=100, layout="tight")
    for item in obstacles:
        if isinstance(item, kl.Circle):
            axes.add_patch(patches.Circle((item.x, item.y), item.radius, color=GREY))
        else:
            axes.add_patch(patches.Polygon(item.vertices, color=GREY))
    for colour, poses in zip(COLOURS, drives, strict=False):
        axes.plot(*np.array(poses)[:, :2].T, color=colour, linewidth=1.8)
        for pose in poses[:: max(1, len(poses) // OUTLINES)]:
            style = {"fill": False, "edgecolor": colour, "alpha": 0.5}
            axes.add_patch(outline(problem.footprint, problem.robot_radius, pose, **style))
    for goal in goals:
        style = {"fill": False, "edgecolor": GREEN, "linestyle": "--", "linewidth": 1.5}
        axes.add_patch(outline(problem.footprint, problem.robot_radius, goal, **style))
        arrow = 1.2 * problem.robot_radius * np.array([np.cos(goal[2]), np.sin(goal[2])])
        axes.annotate(
            "", goal[:2] + arrow, goal[:2], arrowprops={"arrowstyle": "->", "color": GREEN}
        )
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=notes)
    axes.autoscale_view()
    file = Path("out") / "gallery" / f"{name}.png"
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, bbox_inches="tight")
    print(f"wrote {file}")
