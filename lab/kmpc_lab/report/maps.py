"""Map of a run to scale: where the robot drove, past what, and where it meant to go."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lab.report.map_labels import PLAN, Labels, robot_handles
from kmpc_lab.report.map_parts import cross, draw_scenario, footprint, map_axes
from kmpc_lab.report.map_view import contact_point, end_index, view_of
from kmpc_lab.report.style import BLUE, INK, ORANGE, legend_below, style
from kmpc_lab.report.words import clearance_words, outcome_title, substeps
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NICE_TIMES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
ENOUGH, MOMENTS = 4, 8
"""So many footprints between start and end are aimed at, and are the most."""


def map_picture(run: Run) -> Figure:
    """Draw the map to scale: area, obstacles, goal, the robot's path and where it collided.

    The path is drawn with footprints and some of the plans.
    """
    every = substeps(run)
    collided = run.outcome is Outcome.COLLISION
    with style():
        view = view_of(run.scenario, [run])
        figure, axes = map_axes(view)
        end = end_index(run)
        moments = _moments(run, view)
        seconds = np.array([*(run.dt * k for k in moments), run.dt * end / every])
        labels = Labels(axes, view, run.path[:, :2])
        handles = draw_scenario(axes, run.scenario, seconds, labels)
        # with a collision, also what the robot had in mind just before it
        for k in (
            0,
            *moments[:: 1 if len(moments) <= ENOUGH else 2],
            *([len(run.plans) - 1] if collided else []),
        ):
            axes.plot(run.plans[k, :, 0], run.plans[k, :, 1], **PLAN, zorder=4.2)
            labels.avoid_lines(run.plans[k, :, :2])
            axes.plot(
                *run.plans[k, -1, :2],
                "o",
                color=ORANGE,
                markeredgecolor=INK,
                markeredgewidth=0.5,
                markersize=3.2,
                zorder=4.2,
            )
        axes.plot(
            run.path[: end + 1, 0],
            run.path[: end + 1, 1],
            color=BLUE,
            linewidth=2.8,
            zorder=4,
            solid_capstyle="round",
        )
        for index in (0, *(every * k for k in moments), end):
            footprint(axes, run.path[index], run.scenario, strong=index in (0, end))
            labels.avoid(run.path[index], run.scenario.radius)
        labels.put("start", run.path[0, :2], run.scenario.radius, bold=True)
        labels.put("goal", run.scenario.goal[:2], run.scenario.radius, bold=True)
        for k in moments:
            labels.put(f"{run.dt * k:.4g} s", run.states[k, :2], run.scenario.radius)
        if run.outcome is Outcome.TIMEOUT:
            labels.put(
                f"end, {run.duration:.4g} s", run.path[end, :2], run.scenario.radius, bold=True
            )
        if collided:
            point = contact_point(run, end)
            cross(axes, point)
            labels.put(
                f"collision, {run.duration:.4g} s", point, 0.5 * run.scenario.radius, bold=True
            )
        axes.set_title(f"{outcome_title(run)}, {clearance_words(run)}")
        legend_below(figure, [*robot_handles(), *handles])
    return figure


def _moments(run: Run, view: Array) -> list[int]:
    """Choose the periods at which the robot is drawn: few, at round times, apart on the map."""
    apart = max(2.2 * run.scenario.radius, 0.06 * float((view[1] - view[0]).max()))
    taken = [run.states[0, :2], run.states[-1, :2], np.array(run.scenario.goal[:2])]
    best: list[int] = []
    # a robot may stand for most of the drive: look for the longest step that shows enough of the
    # way
    for step in sorted(NICE_TIMES, reverse=True):
        near, chosen = list(taken), []
        for time in np.arange(step, len(run.inputs) * run.dt, step):
            index = min(int(round(time / run.dt)), len(run.inputs) - 1)
            here = run.states[index, :2]
            if min(float(np.hypot(*(here - point))) for point in near) >= apart:
                near.append(here)
                chosen.append(index)
        if len(best) < len(chosen) <= MOMENTS:
            best = chosen
        if len(best) >= ENOUGH:
            break
    return best
