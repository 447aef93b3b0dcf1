"""Distance to the goal, heading error and clearance of a run over time."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lab.report.style import (
    BLUE,
    GREEN,
    INK,
    PURPLE,
    RED,
    legend_below,
    new_figure,
    plain_log_ticks,
    style,
)
from kmpc_lab.report.words import length, path_clearances, path_times
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def errors_picture(run: Run) -> Figure:
    """Draw distance to the goal, heading error and clearance over time, with their limits."""
    scenario = run.scenario
    times, gaps = path_times(run), path_clearances(run)
    distance = distances(run.path, np.array(scenario.goal))
    heading = wrap(run.path[:, 2] - scenario.goal[2])
    # no line across the picture where the error passes half a turn
    heading = np.where(np.abs(np.diff(heading, prepend=heading[0])) > np.pi, np.nan, heading)
    with style():
        from matplotlib.lines import Line2D

        figure = new_figure(5.5 if scenario.obstacle_count else 3.9)
        panels = figure.subplots(3 if scenario.obstacle_count else 2, 1, sharex=True)
        curve: dict[str, Any] = {"color": BLUE, "linewidth": 1.8}
        arrival: dict[str, Any] = {"color": GREEN, "linestyle": "--", "linewidth": 1.3}
        margin: dict[str, Any] = {"color": PURPLE, "linestyle": ":", "linewidth": 1.8}
        contact: dict[str, Any] = {"color": RED, "linewidth": 1.3}
        handles = [
            Line2D(
                [],
                [],
                **arrival,
                label=f"arrived: {length(scenario.tolerance)}, {scenario.heading_tolerance:g} rad",
            )
        ]
        floor = 0.3 * min(scenario.tolerance, max(float(distance[-1]), 0.1 * scenario.tolerance))
        panels[0].plot(times, np.maximum(distance, floor), **curve)
        panels[0].axhline(scenario.tolerance, **arrival)
        panels[0].set_yscale("log")
        plain_log_ticks(panels[0].yaxis)
        panels[0].set_title("Distance to the goal [m], logarithmic")
        panels[1].plot(times, heading, **curve)
        panels[1].set_title("Heading error [rad]")
        for sign in (-1.0, 1.0):
            panels[1].axhline(sign * scenario.heading_tolerance, **arrival)
        if scenario.obstacle_count:
            _draw_clearance(panels[2], times, gaps, curve, contact)
            if scenario.margin > 0.0:
                panels[2].axhline(scenario.margin, **margin)
                handles.append(
                    Line2D([], [], **margin, label=f"margin asked for: {length(scenario.margin)}")
                )
            handles.append(Line2D([], [], **contact, label="contact"))
        panels[0].set_xlim(0.0, 1.01 * times[-1])
        panels[-1].set_xlabel("time [s]")
        legend_below(figure, handles)
    return figure


def _draw_clearance(
    panel: Any, times: Array, gaps: Array, curve: dict[str, Any], contact: dict[str, Any]
) -> None:
    """Draw the clearance over time, where it is smallest, and what would be contact."""
    # as in `Run.clearance`, the start does not count: no command had been given yet
    nearest = 1 + int(np.argmin(gaps[1:]))
    panel.plot(times, gaps, **curve)
    panel.plot(
        times[nearest],
        gaps[nearest],
        "o",
        color=INK,
        markerfacecolor="white",
        markersize=5,
        zorder=5,
    )
    panel.set_title(
        f"Clearance to the nearest obstacle [m], smallest {length(float(gaps[nearest]))}"
    )
    low = min(-0.05 * float(gaps.max()), 1.5 * float(gaps.min()))
    panel.axhspan(low, 0.0, facecolor="#f2b98c", hatch="///", edgecolor="#8f8f8f", linewidth=0.0)
    panel.axhline(0.0, **contact)
    panel.set_ylim(low, None)
