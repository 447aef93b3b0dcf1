"""A log as it was read: its path, and its commands beside what was done."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from kmpc_lab.report.style import (
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
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.cutting import GAP
from kmpc_lite.learn.logs import Log
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MOST_POINTS = 4000
"""Points of a line: more would be drawn upon one another."""
WINDOW, LONGEST = 0.3, 3.0
"""Time over which the motion is given [s]; one that lasts so many times as long holds a gap."""
ARROWS = 24
"""Headings that are drawn along the path."""


def draw_log(log: Log, file: Path) -> None:
    """Write a picture of a log, .svg or .png.

    Raises KmpcError if it cannot be written.
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
        time, held = _broken(log.commands.time[shown] - since, log.commands.values[shown])
        names = (("Forward speed v", "m/s"), ("Turn rate ω", "rad/s"))
        moved_at, moved = _motion(log)
        for k, (panel, (name, unit)) in enumerate(zip(below, names, strict=True)):
            panel.axhline(0.0, color=GREY, linewidth=0.8)
            panel.plot(moved_at - since, moved[:, k], color=GREEN, linewidth=1.0)
            panel.step(time, held[:, k], where="post", color=BLUE, linewidth=1.0)
            panel.set_title(f"{name} [{unit}]")
        below[0].sharex(below[1])
        below[1].set_xlabel("time since the first pose [s]")
        what = "measured speed" if log.measured else "command"
        legend_below(
            figure,
            [
                Line2D([], [], color=BLUE, linewidth=1.2, label=what),
                Line2D([], [], color=GREEN, linewidth=1.2, label="as the poses moved"),
                Line2D([], [], color=GREY, linewidth=1.2, label="path"),
                Line2D([], [], color=RED, linewidth=1.2, label="heading theta"),
                Line2D([], [], color=GREEN, marker="o", linestyle="", label="first pose"),
            ],
            3,
        )
    return figure


def _draw_path(panel: Any, log: Log) -> None:
    """The path, and where the robot faced."""
    shown = _some(len(log.poses.time))
    poses = log.poses.values[shown]
    panel.plot(*_broken(log.poses.time[shown], poses)[1].T[:2], color=GREY, linewidth=1.2)
    panel.plot(*poses[0, :2], color=GREEN, marker="o", markersize=5)
    few = poses[:: max(1, len(poses) // ARROWS)]
    arrow = 0.05 * max(float(np.ptp(poses[:, 0])), float(np.ptp(poses[:, 1])), 1e-9)
    along = arrow * np.column_stack([np.cos(few[:, 2]), np.sin(few[:, 2])])
    units = {"angles": "xy", "scale_units": "xy", "scale": 1.0}
    panel.quiver(*few[:, :2].T, *along.T, color=RED, width=0.004, zorder=3, **units)
    panel.set_aspect("equal", adjustable="datalim")
    panel.set_title("Path [m]")


def _motion(log: Log) -> tuple[Array, Array]:
    """Times (n,) [s], and the speed along the heading and the turn rate of the poses (n, 2)."""
    time, poses = log.poses.time, log.poses.values
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else WINDOW
    n = min(max(1, round(WINDOW / usual)), len(time) - 1)
    shown = _some(len(time) - n)
    begin, end = poses[shown], poses[shown + n]
    seconds = time[shown + n] - time[shown]
    turned = wrap(end[:, 2] - begin[:, 2])
    middle = begin[:, 2] + 0.5 * turned
    ahead = (end[:, 0] - begin[:, 0]) * np.cos(middle) + (end[:, 1] - begin[:, 1]) * np.sin(middle)
    good = (seconds > 0.0) & (seconds < LONGEST * n * usual)  # not across a gap
    rates = np.where(good[:, None], np.column_stack([ahead, turned]), np.nan)
    return time[shown] + 0.5 * seconds, rates / np.where(good, seconds, 1.0)[:, None]


def _broken(time: Array, values: Array) -> tuple[Array, Array]:
    """Times (n,) and values (n, k) with a row of NaN in each gap, at which a line ends."""
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0
    gaps = np.flatnonzero((steps > max(GAP * usual, LONGEST * WINDOW)) | (steps < 0.0)) + 1
    return np.insert(time, gaps, time[gaps - 1]), np.insert(values, gaps, np.nan, axis=0)


def _some(count: int) -> Array:
    """Rows that are drawn, evenly over all of them."""
    every = max(1, -(-count // MOST_POINTS))
    return np.arange(0, count, every)
