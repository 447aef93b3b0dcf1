"""Drives on one map, to scale, over what they were commanded: the one picture of a drive.

The page, ``--picture`` and the worst drives of studies show it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NamedTuple

import numpy as np

from kmpc_lab.report.moments import STATUS_WORDS
from kmpc_lab.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    LINES,
    RED,
    WIDTH,
    legend_below,
    new_figure,
    plain_log_ticks,
    render,
    style,
    write_picture,
)
from kmpc_lite.control import Circle, Footprint, Polygon, Wall
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import corners_of
from kmpc_lite.geometry import wrap
from kmpc_lite.learn.cutting import GAP
from kmpc_lite.learn.logs import Log
from kmpc_lite.scenario.world import World
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TALLEST, PANEL = 7.0, 1.05  # of a map, and height of each panel below it [in]
STATUS_LOOKS = {
    "FEASIBLE": ("#f5e6b8", "..."),
    "FALLBACK": ("#f2b98c", "///"),
    "STOPPED": ("#b9b9b9", "xxx"),
}
SOLID: dict[str, Any] = {"facecolor": "#a9a9a9", "edgecolor": INK, "linewidth": 0.9, "zorder": 2}
APART = 0.08
"""Least distance between two outlines of the robot on a map, as a share of its longer side ..."""
BODIES = 2.4  # ... and in radii of the robot.
Thing = Circle | Polygon | Wall | OccupancyGrid | World


class Trace(NamedTuple):
    """What a picture shows of a drive: T periods of S looks."""

    poses: Array  # (T S + 1, 3); fewer if it ended within a period
    commands: Array  # (T, m)
    statuses: tuple[str, ...]  # (T,)
    goal: Array  # (3,)
    body: Footprint | float  # what the robot covers, or its radius [m]
    around: Sequence[Thing]  # what stands there
    dt: float  # [s]
    looks: int = 1  # S
    gaps: Array | None = None  # clearance at each pose [m]
    step_times: Array | None = None  # (T,) [s]
    limits: Sequence[Any] = ()  # least and largest commands (2,), each perhaps None
    bounds: tuple[float, float, float, float] | None = None
    """Of the area: xmin, ymin, xmax, ymax [m]."""


def drive_picture(drives: Mapping[str, Trace], title: str) -> Figure:
    """Draw drives by their names: a map to scale, and commands, clearance and step times below.

    One drive alone is drawn with the robot's outline at some times, and with how its steps were
    solved; several with a line of their own each.
    """
    traces = list(drives.values())
    first, alone = traces[0], len(traces) == 1
    with style():
        from matplotlib.lines import Line2D

        view = view_of(traces)
        width, height = view[1] - view[0]
        tall = float(np.clip((WIDTH - 0.9) * height / width, 1.2, TALLEST))
        charts = _charts(traces)
        figure = new_figure(tall + 1.2 + PANEL * len(charts))
        heights = (tall, *(PANEL - 0.4 for _ in charts))
        axes, *panels = figure.subplots(1 + len(charts), 1, height_ratios=heights)
        axes.set(xlim=view[:, 0], ylim=view[:, 1], aspect="equal", xlabel="x [m]", ylabel="y [m]")
        figure.suptitle(title, x=0.02, ha="left", fontsize=10, fontweight="bold")
        handles = _draw_map(axes, first, max(t.dt * len(t.commands) for t in traces))
        for number, (name, trace) in enumerate(drives.items()):
            colour, line, _ = LINES[number % len(LINES)]
            look: dict[str, Any] = {"color": colour, "linestyle": line, "linewidth": 1.8}
            axes.plot(*trace.poses[:, :2].T, zorder=4, **look)
            handles.append(Line2D([], [], label="driven path" if alone else name, **look))
            for panel, (_, values) in zip(panels, charts, strict=True):
                _draw_values(panel, trace, values[number], look)
            draw_body(axes, trace.body, trace.poses[-1], colour, 1.5)
        if alone:
            handles += _draw_moments(axes, first, APART * float(max(width, height)))
        for panel, (name, _) in zip(panels, charts, strict=True):
            panel.set_title(name)
            panel.sharex(panels[-1])
            panel.label_outer()
            if alone:
                bands = _draw_statuses(panel, first)
        if panels:
            handles += [*_draw_limits(panels, first), *(bands if alone else ())]
            panels[-1].set_xlabel("time [s]")
        legend_below(figure, handles, 2 if alone else 1)
    return figure


def view_of(traces: Sequence[Trace]) -> Array:
    """Rectangle of a map, [[xmin, ymin], [xmax, ymax]] [m].

    It holds all that was driven, and obstacles and area where they are near.
    """
    first = traces[0]
    size = first.body.radius if isinstance(first.body, Footprint) else first.body
    points = np.concatenate([first.goal[None, :2], *(trace.poses[:, :2] for trace in traces)])
    low, high = points.min(axis=0) - 1.6 * size, points.max(axis=0) + 1.6 * size
    span = float((high - low).max())
    found = [np.empty((0, 2)), *(_extent(thing) for thing in first.around)]
    corners = np.concatenate(found)
    near = corners[((corners > low - 0.35 * span) & (corners < high + 0.35 * span)).all(axis=1)]
    if len(near):
        low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    if first.bounds is not None:
        begin, end = np.array(first.bounds[:2]), np.array(first.bounds[2:])
        low = np.where(low - begin <= 0.6 * span, np.minimum(begin, low), low)
        high = np.where(end - high <= 0.6 * span, np.maximum(end, high), high)
    # a corridor gets some room above and below
    pad = np.maximum(0.03 * (high - low).max(), 0.5 * (0.3 * (high - low).max() - (high - low)))
    return np.array([low - pad, high + pad])


def draw_body(axes: Any, body: Footprint | float, pose: Array, colour: str, width: float) -> None:
    """Draw what a robot covers at a pose (3,), to scale, with a line to its front."""
    from matplotlib import patches

    look: dict[str, Any] = {"fill": False, "edgecolor": colour, "linewidth": width, "zorder": 4.5}
    if isinstance(body, Footprint):
        axes.add_patch(patches.Polygon(body.at(pose), closed=True, **look))
        front = float(body.outline[:, 0].max())
    else:
        axes.add_patch(patches.Circle((float(pose[0]), float(pose[1])), body, **look))
        front = body
    tip = pose[:2] + front * np.array((np.cos(pose[2]), np.sin(pose[2])))
    axes.plot(*np.transpose((pose[:2], tip)), color=colour, linewidth=width, zorder=4.5)


def _draw_map(axes: Any, trace: Trace, seconds: float) -> list[Any]:
    """Draw area, obstacles and goal; returns their legend entries.

    What moves is drawn where it starts, with an arrow to where it is after some seconds.
    """
    from matplotlib import patches
    from matplotlib.collections import LineCollection, PolyCollection
    from matplotlib.lines import Line2D

    side: dict[str, Any] = {"linewidth": 1.2, "linestyle": "-."}
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 9}
    handles = []
    if trace.bounds is not None:
        x, y, right, top = trace.bounds
        box = patches.Rectangle((x, y), right - x, top - y, fill=False, edgecolor=INK, **side)
        axes.add_patch(box)
        handles.append(Line2D([], [], color=INK, label="area bounds", **side))
    if trace.around:
        handles.append(Line2D([], [], color="#a9a9a9", label="obstacle", **dot))
    for thing in trace.around:
        if isinstance(thing, World):
            for x, y, radius in thing.circles[:, :3].tolist():
                axes.add_patch(patches.Circle((x, y), radius, **SOLID))
            lines = thing.edges.reshape(-1, 2, 2)
            axes.add_collection(LineCollection(list(lines), color=INK, linewidth=1.2, zorder=2))
        elif isinstance(thing, Circle):
            moves = bool(thing.vx or thing.vy)
            look = {**SOLID, "facecolor": "#e4e4e4", "hatch": "///"} if moves else SOLID
            axes.add_patch(patches.Circle((thing.x, thing.y), thing.radius, **look))
            if moves:
                to = thing.x + seconds * thing.vx, thing.y + seconds * thing.vy
                look = {"color": "#555555", "arrowstyle": "-|>", "mutation_scale": 9}
                axes.add_patch(patches.FancyArrowPatch((thing.x, thing.y), to, zorder=3, **look))
        elif isinstance(thing, OccupancyGrid):
            # no lines between the rectangles, which are none of the map's
            look = {**SOLID, "edgecolor": SOLID["facecolor"], "linewidth": 0.3}
            axes.add_collection(PolyCollection(list(rectangles(thing)), **look))
        else:
            outline = _capsule(thing) if isinstance(thing, Wall) else corners_of(thing)
            axes.add_collection(PolyCollection([outline], **SOLID))
    draw_body(axes, trace.body, trace.goal, GREEN, 2.2)
    return [*handles, Line2D([], [], color=GREEN, markerfacecolor="none", label="goal", **dot)]


def _draw_moments(axes: Any, trace: Trace, apart: float) -> list[Any]:
    """Draw the robot at some times, which are written in it, and where steps were not solved."""
    from matplotlib.lines import Line2D
    from matplotlib.patheffects import withStroke

    size = trace.body.radius if isinstance(trace.body, Footprint) else trace.body
    shown, poses = [0], trace.poses
    for k in range(len(poses)):
        if np.hypot(*(poses[k] - poses[shown[-1]])[:2]) >= max(apart, BODIES * size):
            shown.append(k)
    for k in shown:
        draw_body(axes, trace.body, poses[k], BLUE, 0.9)
        text = f"{k * trace.dt / trace.looks:.3g}"
        written = axes.text(
            *poses[k, :2], text, ha="center", va="center", fontsize=7, zorder=8, clip_on=True
        )
        written.set_path_effects([withStroke(linewidth=2.0, foreground="white")])
    for status, (colour, _) in STATUS_LOOKS.items():
        at = [k * trace.looks for k, found in enumerate(trace.statuses) if found == status]
        look = {"color": colour, "edgecolor": INK, "linewidth": 0.3}
        axes.scatter(*poses[np.array(at, dtype=int), :2].T, s=9, zorder=4.2, **look)
    dot: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 9}
    label = "robot after so many seconds"
    return [Line2D([], [], color=BLUE, markerfacecolor="none", label=label, **dot)]


def _charts(traces: Sequence[Trace]) -> list[tuple[str, list[Array]]]:
    """Give titles, and the values of each drive: of periods (T,), or of poses (T S + 1,)."""
    sideways = traces[0].commands.shape[1] > 2
    speeds = ("Speed ahead", "Speed to the left") if sideways else ("Forward speed",)
    names = (*(f"{name} [m/s]" for name in speeds), "Turn rate [rad/s]")
    found = [(name, [trace.commands[:, i] for trace in traces]) for i, name in enumerate(names)]
    gaps = [trace.gaps for trace in traces if trace.gaps is not None]
    if len(gaps) == len(traces) and all(np.isfinite(some).any() for some in gaps):
        found.append(("Clearance [m]", gaps))
    times = [1e3 * trace.step_times for trace in traces if trace.step_times is not None]
    if len(times) == len(traces):
        # a clock may say 0, which a logarithmic axis cannot show
        found.append(("Step time [ms]", [np.maximum(some, 1e-3) for some in times]))
    return found


def _draw_values(panel: Any, trace: Trace, values: Array, look: dict[str, Any]) -> None:
    """Draw values over time: commands and step times hold for a period."""
    if len(values) == len(trace.commands):
        edges = trace.dt * np.arange(len(values) + 1)
        panel.stairs(values, edges, baseline=None, **{**look, "linewidth": 1.2})
    else:
        times = trace.dt / trace.looks * np.arange(len(values))
        panel.plot(times, values, **{**look, "linewidth": 1.2})


def _draw_limits(panels: Sequence[Any], trace: Trace) -> list[Any]:
    """Draw limits of commands, contact and period; returns their legend entry if there are any."""
    from matplotlib.lines import Line2D

    look: dict[str, Any] = {"color": INK, "linestyle": ":", "linewidth": 1.2}
    count, bounds = trace.commands.shape[1], [it for it in trace.limits if it is not None]
    for panel, which in zip((panels[0], panels[count - 1]), (0, -1), strict=True):
        panel.axhline(0.0, color=GREY, linewidth=0.8)
        for bound in bounds:
            panel.axhline(float(bound[which]), **look)
    for panel in panels[count:]:
        is_time = panel.get_title(loc="left").startswith("Step")
        panel.axhline(1e3 * trace.dt if is_time else 0.0, **look)
        if is_time:
            panel.set_yscale("log")
            plain_log_ticks(panel.yaxis)
    return [Line2D([], [], label="limit", **look)] if bounds or panels[count:] else []


def _draw_statuses(panel: Any, trace: Trace) -> list[Any]:
    """Shade the periods that were not simply solved; returns a legend entry for each status."""
    from matplotlib.patches import Patch

    spans: dict[str, list[tuple[float, float]]] = {status: [] for status in STATUS_LOOKS}
    begun = 0
    for status, group in groupby(trace.statuses):
        count = len(list(group))
        spans.get(status, []).append((begun * trace.dt, count * trace.dt))
        begun += count
    handles = []
    for status, (colour, hatch) in STATUS_LOOKS.items():
        look: dict[str, Any] = {"facecolor": colour, "hatch": hatch, "linewidth": 0.0}
        look["edgecolor"] = "#8f8f8f"
        if spans[status]:
            # one collection for all spans: in a long run there are thousands
            across = {"transform": panel.get_xaxis_transform(), "zorder": 0.5}
            panel.broken_barh(spans[status], (0.0, 1.0), **across, **look)
            label = f"{STATUS_WORDS[status]} ({trace.statuses.count(status)})"
            handles.append(Patch(**look, label=label))
    return handles


def rectangles(grid: OccupancyGrid) -> Array:
    """Corners of the occupied rectangles (B, 4, 2) [m]."""
    return grid.to_map(grid.rectangles[:, [[0, 1], [2, 1], [2, 3], [0, 3]]])


def _extent(thing: Thing) -> Array:
    """Points (n, 2) that a map shows of a thing [m]."""
    if isinstance(thing, OccupancyGrid):
        return rectangles(thing).reshape(-1, 2)
    if isinstance(thing, Circle | World):
        rows = thing.circles[:, :3] if isinstance(thing, World) else np.array([thing[:3]])
        ends = [rows[:, :2] + sign * rows[:, 2:] for sign in (-1.0, 1.0)]
        edges = thing.edges.reshape(-1, 2) if isinstance(thing, World) else np.empty((0, 2))
        return np.concatenate([*ends, edges])
    return corners_of(thing)


def _capsule(wall: Wall) -> Array:
    """Outline (K, 2) of a wall with round ends."""
    ends = corners_of(wall)
    ahead = float(np.arctan2(*(ends[1] - ends[0])[::-1]))
    turn = np.linspace(-0.5 * np.pi, 0.5 * np.pi, 12)
    halves = [
        end + 0.5 * wall.thickness * np.column_stack([np.cos(to + turn), np.sin(to + turn)])
        for end, to in zip(ends, (ahead + np.pi, ahead), strict=True)
    ]
    return np.concatenate(halves)


MOST_POINTS = 4000  # points of a line: more would be drawn upon one another
WINDOW, LONGEST = 0.3, 3.0
"""Time over which the motion is given [s]; one that lasts so many times as long holds a gap."""
ARROWS = 24  # headings that are drawn along the path


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
