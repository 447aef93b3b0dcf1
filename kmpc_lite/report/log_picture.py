"""A log as it was read: its path, and its commands beside what was done."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from kmpc_lite.learn.logs import Log
from kmpc_lite.report.style import (
    BLUE,
    GREEN,
    GREY,
    RED,
    legend_below,
    new_figure,
    render,
    style,
    write_picture,
)
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 4000
"""Points of a line: more would be drawn upon one another."""
ARROWS = 24
"""Headings that are drawn along the path."""


def draw_log(log: Log, file: Path) -> None:
    """Write a picture of a log, .svg or .png.

    Raises
    ------
    KmpcError
        Where it cannot be written.
    """
    kind: Literal["svg", "png"] = "svg" if file.suffix.lower() == ".svg" else "png"
    write_picture(file, render(log_picture(log), kind))


def log_picture(log: Log) -> Figure:
    """Draw the path with headings, and the commands over time."""
    with style():
        from matplotlib.lines import Line2D

        figure = new_figure(6.4)
        top, *below = figure.subplots(3, 1, height_ratios=(2.4, 1.0, 1.0))
        _draw_path(top, log)
        since = float(log.poses.time.min())
        shown = _some(len(log.commands.time))
        time = log.commands.time[shown] - since
        names = (("Forward speed v", "m/s"), ("Turn rate ω", "rad/s"))
        for k, (panel, (name, unit)) in enumerate(zip(below, names, strict=True)):
            panel.axhline(0.0, color=GREY, linewidth=0.8)
            panel.step(time, log.commands.values[shown, k], where="post", color=BLUE, linewidth=1.0)
            panel.set_title(f"{name} [{unit}]")
        below[0].sharex(below[1])
        below[1].set_xlabel("time since the first pose [s]")
        what = "measured speed" if log.measured else "command"
        legend_below(
            figure,
            [
                Line2D([], [], color=BLUE, linewidth=1.2, label=what),
                Line2D([], [], color=GREY, linewidth=1.2, label="path"),
                Line2D([], [], color=RED, linewidth=1.2, label="heading theta"),
                Line2D([], [], color=GREEN, marker="o", linestyle="", label="first pose"),
            ],
            4,
        )
    return figure


def _draw_path(panel: Any, log: Log) -> None:
    """The path, and where the robot faced."""
    poses = log.poses.values[_some(len(log.poses.time))]
    panel.plot(poses[:, 0], poses[:, 1], color=GREY, linewidth=1.2)
    panel.plot(*poses[0, :2], color=GREEN, marker="o", markersize=5)
    few = poses[:: max(1, len(poses) // ARROWS)]
    arrow = 0.05 * max(float(np.ptp(poses[:, 0])), float(np.ptp(poses[:, 1])), 1e-9)
    for x, y, theta in few:
        ends = np.array([[x, y], [x + arrow * np.cos(theta), y + arrow * np.sin(theta)]])
        panel.plot(*ends.T, color=RED, linewidth=1.2)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_title("Path [m]")


def _some(count: int) -> Array:
    """Rows that are drawn, evenly over all of them."""
    every = max(1, -(-count // MOST_POINTS))
    return np.arange(0, count, every)
