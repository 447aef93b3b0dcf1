"""Film a drive past polygons and circles, one of which moves: the picture of the README.

The robot slips by 5 % on average; the controller knows its floor from a log of 17
minutes. Blue is what was driven, orange the trajectory that the controller plans in each period.
Ends in `out/drive.gif`.

    python examples/animate_drive.py       # needs: pip install 'kmpc-lab[plot]'
"""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.patches import Circle, Polygon

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import Run, Scenario, drive

OUTPUT = Path("out") / "drive.gif"
FRAMES_PER_SECOND = 15
"""One frame a period of 0.1 s: one and a half times as fast as the drive."""
BLUE, ORANGE, GREEN, GREY = "#0072b2", "#e69f00", "#009e73", "#8a8a8a"


def drive_slalom() -> Run:
    floor = kmpc_lab.DifferentialDrive(slip=0.05, seed=1)
    model = kl.fit(kmpc_lab.generate_dataset(floor, episodes=100, steps=100, dt=0.1, seed=1))
    scenario = Scenario.load("polygons")
    return drive(kl.Controller(model, scenario.problem()), scenario, dt=model.dt)


def draw_map(axes: Any, scenario: Scenario) -> list[Circle]:
    """Draw what stands still; give the patches of the circles, which may move."""
    xmin, ymin, xmax, ymax = scenario.bounds
    axes.set(xlim=(xmin, xmax), ylim=(ymin, ymax), aspect="equal", xticks=[], yticks=[])
    for polygon in scenario.polygons:
        axes.add_patch(Polygon(polygon.vertices, color=GREY))
    x, y, _ = scenario.goal
    axes.add_patch(Circle((x, y), scenario.radius, fill=False, color=GREEN, linestyle="--"))
    axes.text(x, y - 0.27, "goal", color=GREEN, ha="center", va="top")
    patches = [Circle(circle[:2], circle.radius, color=GREY) for circle in scenario.circles]
    for patch in patches:
        axes.add_patch(patch)
    return patches


def animate(run: Run) -> FuncAnimation:
    figure, axes = plt.subplots(figsize=(4.2, 4.2), dpi=80, layout="tight")
    circles = draw_map(axes, run.scenario)
    (driven,) = axes.plot([], [], color=BLUE, linewidth=2.5)
    (planned,) = axes.plot([], [], color=ORANGE, linewidth=2.0)
    (heading,) = axes.plot([], [], color="black", linewidth=1.5, zorder=5)
    robot = axes.add_patch(Circle((0, 0), run.scenario.radius, facecolor="#cfe3f2", edgecolor=BLUE))

    def show(period: int) -> None:
        pose = run.states[period]
        robot.center = tuple(pose[:2])
        nose = pose[:2] + run.scenario.radius * np.array([np.cos(pose[2]), np.sin(pose[2])])
        heading.set_data([pose[0], nose[0]], [pose[1], nose[1]])
        driven.set_data(run.states[: period + 1, 0], run.states[: period + 1, 1])
        plan = run.plans[min(period, len(run.plans) - 1)]
        planned.set_data(plan[:, 0], plan[:, 1])
        for patch, circle in zip(circles, run.scenario.circles_at(period * run.dt), strict=True):
            patch.center = tuple(circle[:2])
        axes.set_title(f"{period * run.dt:.1f} s", loc="left", fontsize=10)

    # the last frame stays for a second and a half
    frames = [*range(len(run.states)), *[len(run.states) - 1] * 22]
    return FuncAnimation(figure, show, frames=frames)


def main() -> None:
    run = drive_slalom()
    print(f"{run.outcome.value} after {run.duration:.1f} s, clearance {100 * run.clearance:.1f} cm")
    OUTPUT.parent.mkdir(exist_ok=True)
    animate(run).save(OUTPUT, writer=PillowWriter(fps=FRAMES_PER_SECOND))
    print(f"wrote {OUTPUT} ({OUTPUT.stat().st_size / 1e3:.0f} kB)")


if __name__ == "__main__":
    main()
