"""Step times of all contenders as one picture: the share of steps that took longer than a time."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kmpc_lab.bench.measure import Measurement
from kmpc_lab.report.style import LINES, legend_below, new_figure, render, style, write_picture


def write_bench_picture(path: Path, results: Sequence[Measurement]) -> None:
    """Draw the tails of the distributions into a PNG: it is the tail that misses deadlines.

    Both axes are logarithmic.
    """
    with style():
        figure = new_figure(3.6)
        axes = figure.add_subplot()
        handles = []
        for result, (colour, line, marker) in zip(results, LINES, strict=False):
            times = 1e3 * np.sort(result.times)
            share = 1.0 - np.arange(len(times)) / len(times)
            every = max(1, len(times) // 8)
            handles += axes.step(
                times,
                share,
                where="post",
                color=colour,
                linestyle=line,
                marker=marker,
                markevery=every,
                markersize=4,
                label=result.name,
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("time of a step [ms]")
        axes.set_ylabel("share of steps that took longer")
        axes.set_title(f"{len(results[0].times)} steps each, the same states, in one run")
        legend_below(figure, handles)
        write_picture(path, render(figure, "png"))
