"""The commands of a run over time."""

from __future__ import annotations

from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.report.style import BLUE, GREY, RED, legend_below, new_figure, style
from kmpc_lab.report.words import STATUS_WORDS, substeps
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.errors import KmpcError

if TYPE_CHECKING:
    from matplotlib.figure import Figure


STATUS_LOOKS = {
    PlanStatus.FEASIBLE.name: ("#f5e6b8", "..."),
    PlanStatus.FALLBACK.name: ("#f2b98c", "///"),
    PlanStatus.STOPPED.name: ("#b9b9b9", "xxx"),
}


def commands_picture(
    run: Run, u_min: ArrayLike | None = None, u_max: ArrayLike | None = None
) -> Figure:
    """Draw the commands over time, with their limits, and when a step was not simply solved.

    `run`: what was driven. `u_min`, `u_max`: limits (2,) [m/s, rad/s]; `limits` says where they
    come from if not given.
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
            handles, commands = _status_bands(panel, run), run.inputs[:, [0, -1][i]]
            panel.axhline(0.0, color=GREY, linewidth=0.8)
            panel.stairs(commands, edges, baseline=None, color=BLUE, linewidth=1.8)
            bounds = [float(bound[i]) for bound in (low, high) if bound is not None]
            for bound in bounds:
                panel.axhline(bound, color=RED, linestyle="--", linewidth=1.3)
            around = np.array([*bounds, *commands[np.isfinite(commands)], 0.0])
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

    Raises KmpcError for limits that are not two numbers.
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
