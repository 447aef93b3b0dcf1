"""Trajectories of several runs on one map to scale."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lab.report.map_labels import Labels, series_handles
from kmpc_lab.report.map_parts import cross, draw_scenario, footprint, map_axes
from kmpc_lab.report.map_view import contact_point, end_index, view_of
from kmpc_lab.report.style import LINES, legend_below, style
from kmpc_lab.report.words import substeps
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.errors import KmpcError
from kmpc_lite.scenario.files import Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def overlay_picture(runs: Sequence[Run], labels: Sequence[str]) -> Figure:
    """Draw the trajectories of several runs on one map, as studies need it.

    `runs`: on one map: same bounds, obstacles, goal and robot radius. `labels`: one for each run;
    runs with the same label share colour, line and legend entry. Raises KmpcError for no runs,
    another number of labels, or runs of different maps.
    """
    check_one_map(runs, labels)
    scenario, names = runs[0].scenario, list(dict.fromkeys(labels))
    outcomes = [run.outcome for run in runs]
    with style():
        view = view_of(scenario, runs)
        figure, axes = map_axes(view)
        written = Labels(axes, view, np.concatenate([run.path[:, :2] for run in runs]))
        handles = draw_scenario(
            axes, scenario, np.array([max(run.duration for run in runs)]), written
        )
        for run, label in zip(runs, labels, strict=True):
            _draw(axes, run, LINES[names.index(label) % len(LINES)])
        for start in dict.fromkeys(run.scenario.start for run in runs):
            footprint(axes, np.array(start), scenario, strong=True)
        written.put("start", scenario.start[:2], scenario.radius, bold=True)
        written.put("goal", scenario.goal[:2], scenario.radius, bold=True)
        counts = [
            outcomes.count(outcome)
            for outcome in (Outcome.REACHED, Outcome.COLLISION, Outcome.TIMEOUT)
        ]
        axes.set_title(
            f"{len(runs)} runs: {counts[0]} reached, {counts[1]} collided, {counts[2]} out of time"
        )
        legend_below(
            figure,
            [*series_handles(names, list(labels), counts), *handles],
            2 if max(map(len, names)) > 14 else 3,
        )
    return figure


def check_one_map(runs: Sequence[Run], labels: Sequence[str]) -> None:
    """Raise KmpcError for no runs, another number of labels, or runs of different maps."""
    if not runs or len(runs) != len(labels):
        raise KmpcError(
            "overlay: expected at least one run and a label for each, "
            f"got {len(runs)} runs and {len(labels)} labels"
        )
    scenario = runs[0].scenario
    for i, run in enumerate(runs):
        substeps(run)
        if _map_of(run.scenario) != _map_of(scenario):
            raise KmpcError(
                f"overlay: run {i} ({run.scenario.name}) has another map than the first "
                f"({scenario.name})"
            )


def _draw(axes: Any, run: Run, series: tuple[Any, Any, Any]) -> None:
    """Draw a trajectory, and how it ended, in a series' colour, line and marker."""
    colour, line, marker = series
    end = end_index(run)
    path = run.path[: end + 1]
    axes.plot(path[:, 0], path[:, 1], color=colour, linestyle=line, linewidth=1.5, zorder=4)
    if run.outcome is Outcome.COLLISION:
        cross(axes, contact_point(run, end))
        return
    axes.plot(
        *run.path[end, :2],
        marker,
        color=colour,
        markerfacecolor=colour if run.outcome is Outcome.REACHED else "white",
        markersize=5.5,
        zorder=6,
    )


def _map_of(scenario: Scenario) -> tuple[object, ...]:
    return (
        scenario.bounds,
        scenario.circles,
        scenario.polygons,
        scenario.walls,
        scenario.grid,
        scenario.goal,
        scenario.footprint or scenario.radius,
    )
