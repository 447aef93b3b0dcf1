"""How well a model predicts, beside the nominal unicycle."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lab.report.style import BLUE, INK, SMALL, legend_below, new_figure, style
from kmpc_lite.learn.evaluation import FitReport

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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
                _draw_bar(panel, y, value, min(value, top), unit, looks[who])
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


def _draw_bar(
    panel: Any, y: float, value: float, drawn: float, unit: str, look: tuple[str, str]
) -> None:
    """Draw an error at a height, and write it beside; an infinite one is written in words."""
    colour, hatch = look
    panel.barh(y, drawn, height=0.92, color=colour, hatch=hatch, edgecolor=INK, linewidth=0.6)
    known = bool(np.isfinite(value))
    text = f"{value:.3g} {unit}" if known else "diverged"
    place = (value, y) if known else (0.0, y)
    over: dict[str, Any] = (
        {} if known else {"bbox": {"facecolor": "white", "edgecolor": "none", "pad": 1.5}}
    )
    panel.annotate(
        text, place, xytext=(4, 0), textcoords="offset points", va="center", fontsize=SMALL, **over
    )
