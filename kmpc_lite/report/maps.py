"""Maps to scale: where the robot drove, past what, and where it meant to go."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.obstacles.circles import circle_distances
from kmpc_lite.errors import KmpcError
from kmpc_lite.report.map_labels import Labels
from kmpc_lite.report.map_legends import PLAN, robot_handles, series_handles
from kmpc_lite.report.map_parts import cross, draw_scenario, footprint, goal_front, map_axes
from kmpc_lite.report.solid_parts import solid_points
from kmpc_lite.report.style import BLUE, INK, LINES, ORANGE, legend_below, style
from kmpc_lite.report.words import clearance_words, outcome_title, substeps
from kmpc_lite.sim.closed_loop import Outcome, Run
from kmpc_lite.sim.scenario.files import Scenario
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NICE_TIMES = (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0)
ENOUGH, MOMENTS = 4, 8
"""So many footprints between start and end are aimed at, and are the most."""
NO_DISTANCES = np.empty((1, 0)), np.empty((1, 0, 2))


def map_picture(run: Run) -> Figure:
    """Draw the map to scale: area, obstacles, goal, the robot's path and where it collided.

    The path is drawn with footprints and some of the plans.
    """
    every = substeps(run)
    collided = run.outcome is Outcome.COLLISION
    with style():
        view = view_of(run.scenario, [run])
        figure, axes = map_axes(view)
        end = _end_index(run)
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
            point = _contact(run, end)
            cross(axes, point)
            labels.put(
                f"collision, {run.duration:.4g} s", point, 0.5 * run.scenario.radius, bold=True
            )
        axes.set_title(f"{outcome_title(run)}, {clearance_words(run)}")
        legend_below(figure, [*robot_handles(), *handles])
    return figure


def overlay_picture(runs: Sequence[Run], labels: Sequence[str]) -> Figure:
    """Draw the trajectories of several runs on one map, as studies need it.

    Parameters
    ----------
    runs : sequence of Run
        On one map: same bounds, obstacles, goal and robot radius.
    labels : sequence of str
        One for each run; runs with the same label share colour, line and legend entry.

    Raises
    ------
    KmpcError
        For no runs, another number of labels, or runs of different maps.
    """
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
    names = list(dict.fromkeys(labels))
    outcomes = [run.outcome for run in runs]
    with style():
        view = view_of(scenario, runs)
        figure, axes = map_axes(view)
        written = Labels(axes, view, np.concatenate([run.path[:, :2] for run in runs]))
        handles = draw_scenario(
            axes, scenario, np.array([max(run.duration for run in runs)]), written
        )
        for run, label in zip(runs, labels, strict=True):
            colour, line, marker = LINES[names.index(label) % len(LINES)]
            end = _end_index(run)
            axes.plot(
                run.path[: end + 1, 0],
                run.path[: end + 1, 1],
                color=colour,
                linestyle=line,
                linewidth=1.5,
                zorder=4,
            )
            if run.outcome is Outcome.COLLISION:
                cross(axes, _contact(run, end))
            else:
                face = colour if run.outcome is Outcome.REACHED else "white"
                axes.plot(
                    *run.path[end, :2],
                    marker,
                    color=colour,
                    markerfacecolor=face,
                    markersize=5.5,
                    zorder=6,
                )
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


def view_of(scenario: Scenario, runs: Sequence[Run]) -> Array:
    """Rectangle of the map to show, [[xmin, ymin], [xmax, ymax]] [m].

    It holds all that was driven, and obstacles and area where they are near.
    """
    ends = np.array([scenario.start[:2], scenario.goal[:2], goal_front(scenario)])
    points = np.concatenate([*(run.path[:, :2] for run in runs), ends])
    low, high = points.min(axis=0) - scenario.radius, points.max(axis=0) + scenario.radius
    span = float((high - low).max())
    near_low, near_high = low - 0.35 * span, high + 0.35 * span
    for circle in scenario.circles:
        centre = np.array(circle[:2])
        if ((centre > near_low) & (centre < near_high)).all():
            low, high = (
                np.minimum(low, centre - circle.radius),
                np.maximum(high, centre + circle.radius),
            )
    if scenario.solids is not None:
        corners = solid_points(scenario.solids.solids)
        near = corners[((corners > near_low) & (corners < near_high)).all(axis=1)]
        if len(near):
            low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    area_low, area_high = np.array(scenario.bounds[:2]), np.array(scenario.bounds[2:])
    low = np.where(low - area_low <= 0.6 * span, np.minimum(area_low, low), low - 0.15 * span)
    high = np.where(area_high - high <= 0.6 * span, np.maximum(area_high, high), high + 0.15 * span)
    # a corridor gets some room above and below, or nothing could be written beside the robot
    pad = np.maximum(0.04 * (high - low).max(), 0.5 * (0.35 * (high - low).max() - (high - low)))
    return np.array([low - pad, high + pad])


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


def _end_index(run: Run) -> int:
    """Index in `Run.path` of the sub-sample at which the drive ended."""
    last = len(run.path) - 1
    return (
        min(int(round(run.duration / run.dt * substeps(run))), last)
        if run.outcome is Outcome.COLLISION
        else last
    )


def _contact(run: Run, index: int) -> Array:
    """Give the point (2,) of the obstacle's edge that the robot ran into."""
    here, time = run.path[index : index + 1, :2], np.array([index * run.dt / substeps(run)])
    distances, normals = (
        circle_distances(run.scenario.circles_at(0.0), here, time)
        if run.scenario.circles
        else NO_DISTANCES
    )
    if run.scenario.solids is not None:
        gaps, away = run.scenario.solids.whole.measure(here)
        distances, normals = (
            np.concatenate([distances, gaps], axis=1),
            np.concatenate([normals, away], axis=1),
        )
    hit = int(np.argmin(distances[0]))
    point: Array = here[0] - distances[0, hit] * normals[0, hit]
    return point
