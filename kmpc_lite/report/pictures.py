"""Pictures over time: commands, errors, step times; and how well the model predicts."""

from __future__ import annotations

from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.errors import KmpcError
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.learn.evaluation import FitReport
from kmpc_lite.report.maps import map_picture
from kmpc_lite.report.style import (
    BLUE,
    GREEN,
    GREY,
    INK,
    PURPLE,
    RED,
    SMALL,
    legend_below,
    new_figure,
    render,
    style,
    write_picture,
)
from kmpc_lite.report.words import (
    STATUS_WORDS,
    length,
    milliseconds,
    path_clearances,
    path_times,
    substeps,
)
from kmpc_lite.sim.closed_loop import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STATUS_LOOKS = {
    PlanStatus.FEASIBLE.name: ("#f5e6b8", "..."),
    PlanStatus.FALLBACK.name: ("#f2b98c", "///"),
    PlanStatus.STOPPED.name: ("#b9b9b9", "xxx"),
}
MANY = 2000
"""More dots than this are drawn as pixels, or the file would grow with the run."""


def commands_picture(
    run: Run, u_min: ArrayLike | None = None, u_max: ArrayLike | None = None
) -> Figure:
    """Draw the commands over time, with their limits, and when a step was not simply solved.

    Parameters
    ----------
    run : Run
        What was driven.
    u_min, u_max : array_like, optional
        Limits (2,) [m/s, rad/s]; `limits` says where they come from if not given.
    """
    substeps(run)
    low, high = limits(run, u_min, u_max)
    edges = run.dt * np.arange(len(run.inputs) + 1)
    with style():
        from matplotlib.lines import Line2D

        figure = new_figure(3.9)
        panels = figure.subplots(2, 1, sharex=True)
        for i, (panel, title, unit) in enumerate(
            zip(panels, ("Forward speed v", "Turn rate ω"), ("m/s", "rad/s"), strict=True)
        ):
            handles = _status_bands(panel, run)
            panel.axhline(0.0, color=GREY, linewidth=0.8)
            panel.stairs(run.inputs[:, i], edges, baseline=None, color=BLUE, linewidth=1.8)
            bounds = [float(bound[i]) for bound in (low, high) if bound is not None]
            for bound in bounds:
                panel.axhline(bound, color=RED, linestyle="--", linewidth=1.3)
            around = np.array([*bounds, *run.inputs[np.isfinite(run.inputs[:, i]), i], 0.0])
            pad = 0.1 * float(np.ptp(around)) or 0.1
            panel.set_ylim(float(around.min()) - pad, float(around.max()) + pad)
            panel.set_title(f"{title} [{unit}]")
        panels[0].set_xlim(0.0, edges[-1])
        panels[1].set_xlabel("time [s]")
        lines = [Line2D([], [], color=BLUE, linewidth=1.8, label="command")]
        if low is not None or high is not None:
            lines.append(Line2D([], [], color=RED, linestyle="--", linewidth=1.3, label="limit"))
        legend_below(figure, lines + handles, 2)
    return figure


def limits(run: Run, u_min: ArrayLike | None, u_max: ArrayLike | None) -> tuple[Any, Any]:
    """Command limits (2,) each, or None.

    Those given come first, else what the run keeps as ``info["u_min"]`` and ``info["u_max"]``.

    Raises
    ------
    KmpcError
        For limits that are not two numbers.
    """
    found: list[Any] = []
    for name, given in (("u_min", u_min), ("u_max", u_max)):
        value = run.info.get(name) if given is None else given
        try:
            array = None if value is None else np.asarray(value, dtype=float)
        except (TypeError, ValueError) as error:
            raise KmpcError(f"{name}: expected two numbers, got {value!r}") from error
        if array is not None and (array.shape != (2,) or not np.isfinite(array).all()):
            raise KmpcError(f"{name}: expected two numbers, got {value!r}")
        found.append(array)
    return found[0], found[1]


def _status_bands(panel: Any, run: Run) -> list[Any]:
    """Shade the periods whose status is not SOLVED; one legend entry per status that occurs."""
    from matplotlib.patches import Patch

    spans: dict[str, list[tuple[float, float]]] = {status: [] for status in STATUS_LOOKS}
    first = 0
    for status, group in groupby(run.statuses):
        count = len(list(group))
        if status in spans:
            spans[status].append((first * run.dt, count * run.dt))
        first += count
    handles = []
    for status, (colour, hatch) in STATUS_LOOKS.items():
        if spans[status]:
            look: dict[str, Any] = {
                "facecolor": colour,
                "hatch": hatch,
                "edgecolor": "#8f8f8f",
                "linewidth": 0.0,
            }
            # one collection for all spans: in a long run there are thousands
            panel.broken_barh(
                spans[status], (0.0, 1.0), transform=panel.get_xaxis_transform(), zorder=0.5, **look
            )
            handles.append(
                Patch(**look, label=f"{STATUS_WORDS[status]} ({run.statuses.count(status)})")
            )
    return handles


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
        _plain_log_ticks(panels[0].yaxis)
        panels[0].set_title("Distance to the goal [m], logarithmic")
        panels[1].plot(times, heading, **curve)
        panels[1].set_title("Heading error [rad]")
        for sign in (-1.0, 1.0):
            panels[1].axhline(sign * scenario.heading_tolerance, **arrival)
        if scenario.obstacle_count:
            # as in `Run.clearance`, the start does not count: no command had been given yet
            nearest = 1 + int(np.argmin(gaps[1:]))
            panels[2].plot(times, gaps, **curve)
            panels[2].plot(
                times[nearest],
                gaps[nearest],
                "o",
                color=INK,
                markerfacecolor="white",
                markersize=5,
                zorder=5,
            )
            panels[2].set_title(
                f"Clearance to the nearest obstacle [m], smallest {length(float(gaps[nearest]))}"
            )
            low = min(-0.05 * float(gaps.max()), 1.5 * float(gaps.min()))
            panels[2].axhspan(
                low, 0.0, facecolor="#f2b98c", hatch="///", edgecolor="#8f8f8f", linewidth=0.0
            )
            panels[2].axhline(0.0, **contact)
            panels[2].set_ylim(low, None)
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


def _plain_log_ticks(axis: Any) -> None:
    """Ticks at 1, 2, 5 in plain numbers, not as powers."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = axis.get_view_interval()
    wide = high / low > 1e3
    axis.set_major_locator(LogLocator(subs=(1.0,) if wide else (1.0, 2.0, 5.0)))
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_formatter(NullFormatter())


def timing_picture(run: Run) -> Figure:
    """Draw the time of each step and how the times are distributed, against the period."""
    substeps(run)
    # a clock may say 0, which a logarithmic axis cannot show
    values = np.maximum(1e3 * run.step_times, 1e-3)
    times, period = run.dt * np.arange(len(values)), 1e3 * run.dt
    marks = (
        ("half within {} (p50)", float(np.median(values)), BLUE, "-"),
        ("99 % within {} (p99)", float(np.quantile(values, 0.99)), PURPLE, "-."),
        ("all within {} (max)", float(values.max()), INK, ":"),
        ("budget: the period, {}", period, RED, "--"),
    )
    with style():
        from matplotlib.lines import Line2D

        figure = new_figure(3.1)
        over_time, share = figure.subplots(1, 2, sharey=True, width_ratios=(2.6, 1))
        over_time.plot(
            times,
            values,
            ".",
            color=GREY,
            markeredgecolor=INK,
            markeredgewidth=0.3,
            markersize=5,
            rasterized=len(values) > MANY,
        )
        low, high = 0.7 * float(values.min()), 1.6 * max(period, float(values.max()))
        bins = np.geomspace(float(values.min()) * 0.97, float(values.max()) * 1.03, 25)
        weights = np.full(len(values), 100.0 / len(values))
        share.hist(
            values,
            bins=bins,
            weights=weights,
            orientation="horizontal",
            color="#c9c9c9",
            edgecolor="#777777",
            linewidth=0.5,
        )
        for panel in (over_time, share):
            for _, value, colour, line in marks:
                panel.axhline(value, color=colour, linestyle=line, linewidth=1.5)
        over_time.set_yscale("log")
        over_time.set_ylim(low, high)
        over_time.set_xlim(-0.02 * run.dt * len(values), run.dt * len(values))
        _plain_log_ticks(over_time.yaxis)
        over_time.set(xlabel="time [s]", ylabel="step time [ms], logarithmic")
        share.set_xlabel("share of steps [%]")
        over_time.set_title(
            f"The slowest step took {_share_of(float(values.max()) / period)} of the period"
        )
        handles = [
            Line2D(
                [],
                [],
                color=c,
                linestyle=line,
                linewidth=1.5,
                label=who.format(milliseconds(1e-3 * v)),
            )
            for who, v, c, line in marks
        ]
        legend_below(figure, handles, 2)
    return figure


def _share_of(ratio: float) -> str:
    return f"{100 * ratio:.2g} %" if ratio < 0.995 else f"{ratio:.2g} times the length"


def fit_picture(report: FitReport) -> Figure:
    """Draw held-out errors of model and nominal unicycle, after one step and the horizon."""
    rows = (
        ("one step", "model", report.one_step),
        ("one step", "nominal", report.nominal_one_step),
        (f"{report.horizon:g} s", "model", report.multi_step),
        (f"{report.horizon:g} s", "nominal", report.nominal_multi_step),
    )
    looks = {"model": (BLUE, ""), "nominal": ("#f0d9a8", "///")}
    where = np.array([0.0, 1.0, 2.4, 3.4])
    over: tuple[dict[str, Any], dict[str, Any]] = (
        {},
        {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.5}},
    )
    with style():
        from matplotlib.patches import Patch

        figure = new_figure(4.9)
        panels = figure.subplots(3, 1)
        for i, (panel, name, unit) in enumerate(
            zip(
                panels,
                ("Along the heading", "Across the heading", "Heading"),
                ("mm", "mm", "mrad"),
                strict=True,
            )
        ):
            values = [1e3 * row[2][i] for row in rows]
            # a model that diverges has an infinite error: its bar ends where the picture does
            top = 1.2 * max([value for value in values if np.isfinite(value)] + [1e-12])
            for y, (_, who, _), value in zip(where, rows, values, strict=True):
                colour, hatch = looks[who]
                panel.barh(
                    y,
                    min(value, top),
                    height=0.92,
                    color=colour,
                    hatch=hatch,
                    edgecolor=INK,
                    linewidth=0.6,
                )
                text = f"{value:.3g} {unit}" if np.isfinite(value) else "diverged"
                place = (value, y) if np.isfinite(value) else (0.0, y)
                panel.annotate(
                    text,
                    place,
                    xytext=(4, 0),
                    textcoords="offset points",
                    va="center",
                    fontsize=SMALL,
                    **over[text == "diverged"],
                )
            panel.set_yticks([0.5, 2.9], ["one step", f"{report.horizon:g} s ahead"])
            panel.tick_params(axis="y", length=0)
            panel.grid(visible=False, axis="y")
            panel.invert_yaxis()
            panel.set_xlim(0.0, top)
            panel.set_title(f"{name}: RMS error [{unit}]")
        names = {"model": "learned model", "nominal": "nominal unicycle"}
        legend_below(
            figure,
            [
                Patch(facecolor=c, hatch=h, edgecolor=INK, linewidth=0.6, label=names[who])
                for who, (c, h) in looks.items()
            ],
        )
    return figure


def run_pictures(
    run: Run, fit_report: FitReport | None, u_min: ArrayLike | None, u_max: ArrayLike | None
) -> dict[str, Figure]:
    """Give every picture of a run by its name."""
    found = {
        "map": map_picture(run),
        "commands": commands_picture(run, u_min, u_max),
        "errors": errors_picture(run),
        "timing": timing_picture(run),
    }
    return found if fit_report is None else {**found, "fit": fit_picture(fit_report)}


def write_pictures(
    folder: str | Path,
    run: Run,
    fit_report: FitReport | None = None,
    *,
    u_min: ArrayLike | None = None,
    u_max: ArrayLike | None = None,
) -> list[Path]:
    """Write the pictures of a run as PNG files.

    These are ``map.png``, ``commands.png``, ``errors.png``, ``timing.png`` and, with a fit
    report, ``fit.png``.

    Parameters
    ----------
    folder : path
        Made where missing.
    run : Run
        What was driven.
    fit_report : FitReport, optional
        Held-out errors of its model.
    u_min, u_max : array_like, optional
        Command limits (2,) [m/s, rad/s]; what the run keeps in its `info` where not given.

    Returns
    -------
    list of Path
        The files written, 150 dots per inch.

    Raises
    ------
    KmpcError
        Where matplotlib is missing or a file cannot be written.
    """
    target = Path(folder)
    pictures = run_pictures(run, fit_report, u_min, u_max)
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise KmpcError(f"{target}: cannot make the folder: {error.strerror or error}") from error
    paths = [target / f"{name}.png" for name in pictures]
    for path, figure in zip(paths, pictures.values(), strict=True):
        write_picture(path, render(figure, "png"))
    return paths
