"""The step times of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lab.report.style import (
    BLUE,
    GREY,
    INK,
    PURPLE,
    RED,
    legend_below,
    new_figure,
    plain_log_ticks,
    style,
)
from kmpc_lab.report.words import milliseconds, substeps
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


MANY = 2000
"""More dots than this are drawn as pixels, or the file would grow with the run."""


def timing_picture(run: Run) -> Figure:
    """Draw the time of each step and how the times are distributed, against the period."""
    substeps(run)
    # a clock may say 0, which a logarithmic axis cannot show
    values = np.maximum(1e3 * run.step_times, 1e-3)
    times, period = run.dt * np.arange(len(values)), 1e3 * run.dt
    marks = _marks(values, period)
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
        plain_log_ticks(over_time.yaxis)
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


def _marks(values: Array, period: float) -> tuple[tuple[str, float, str, str], ...]:
    """Lines across the picture: what they tell, where they are [ms], their colour and dashes."""
    return (
        ("half within {} (p50)", float(np.median(values)), BLUE, "-"),
        ("99 % within {} (p99)", float(np.quantile(values, 0.99)), PURPLE, "-."),
        ("all within {} (max)", float(values.max()), INK, ":"),
        ("budget: the period, {}", period, RED, "--"),
    )
