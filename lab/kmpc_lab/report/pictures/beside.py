"""Drives of one map beside each other: where they went, and how fast."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from kmpc_lab.report.map_labels import Labels
from kmpc_lab.report.map_parts import draw_scenario, footprint
from kmpc_lab.report.map_view import view_of
from kmpc_lab.report.overlay import check_one_map
from kmpc_lab.report.style import LINES, style
from kmpc_lab.sim.closed_loop import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def beside_picture(runs: Sequence[Run], labels: Sequence[str]) -> Figure:
    """Draw paths and commanded speeds of several runs, with duration and least clearance of each.

    `runs`: on one map. `labels`: one for each run. Raises KmpcError for no runs, another number of
    labels, or runs of different maps.
    """
    check_one_map(runs, labels)
    scenario = runs[0].scenario
    with style():
        from matplotlib.figure import Figure

        figure = Figure(figsize=(7.2, 6.4), layout="constrained")
        above, below = figure.subplots(2, 1)
        view = view_of(scenario, runs)
        written = Labels(above, view, np.concatenate([run.path[:, :2] for run in runs]))
        draw_scenario(above, scenario, np.zeros(1), written)
        footprint(above, np.array(scenario.start), scenario, strong=True)
        for number, (run, label) in enumerate(zip(runs, labels, strict=True)):
            colour, line, _ = LINES[number % len(LINES)]
            clear = f", {100 * run.clearance:.1f} cm" if np.isfinite(run.clearance) else ""
            name = f"{label}: {run.outcome.value} after {run.duration:.1f} s{clear}"
            above.plot(*run.path[:, :2].T, color=colour, linestyle=line, label=name, zorder=4)
            times = run.dt * np.arange(len(run.inputs))
            below.step(times, run.inputs[:, 0], where="post", color=colour, linestyle=line)
        above.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
        places = np.concatenate([run.path[:, :2] for run in runs])
        low, high = places.min(axis=0), places.max(axis=0)
        above.set(xlim=(low[0] - 0.3, high[0] + 0.3), ylim=(low[1] - 0.4, high[1] + 0.4))
        below.set(xlabel="time [s]", ylabel="commanded speed [m/s]")
        figure.legend(*above.get_legend_handles_labels(), loc="outside lower center", ncols=2)
    return figure
