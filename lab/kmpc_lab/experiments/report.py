"""Tables and pictures of the experiments."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from kmpc_lab.experiments.study import EXPERIMENTS
from kmpc_lab.experiments.trials import Trial
from kmpc_lab.report.style import LINES, style
from kmpc_lab.sim.closed_loop import Outcome

COLUMNS = (
    "controller",
    "maps",
    "drives",
    "contacts",
    "reached",
    "s to the goal",
    "mean / worst final error [m]",
    "least gap [mm]",
    "heading off by [mrad]",
)
"""The last: between plan and truth one period later, root mean square."""


def table(which: str, trials: Sequence[Trial]) -> str:
    """Render as Markdown: a row for each controller over all maps, and one for each of its maps."""
    experiment = EXPERIMENTS[which]
    lines = [
        f"experiment ({which}): {experiment.title}; paper: {experiment.paper}",
        "",
        "| " + " | ".join(COLUMNS) + " |",
    ]
    lines.append("|" + "---|" * len(COLUMNS))
    for label in dict.fromkeys(t.label for t in trials):
        own = [t for t in trials if t.label == label]
        maps = list(dict.fromkeys(t.run.scenario.name for t in own))
        lines += [_row(label, "all", own)] if len(maps) > 1 else []
        lines += [
            _row(label, name.removeprefix("twin_"), [t for t in own if t.run.scenario.name == name])
            for name in maps
        ]
    return "\n".join(lines)


def _row(label: str, maps: str, trials: Sequence[Trial]) -> str:
    contacts = sum(t.run.outcome is Outcome.COLLISION for t in trials)
    reached = [t for t in trials if t.run.outcome is Outcome.REACHED]
    free = [t for t in trials if t.run.outcome is not Outcome.COLLISION]
    times = f"{np.mean([t.run.info['arrival_s'] for t in reached]):.1f}" if reached else "-"
    errors = (
        f"{np.mean([t.final_error for t in free]):.3f} / {max(t.final_error for t in free):.3f}"
        if free
        else "-"
    )
    gap = 1e3 * min(t.run.clearance for t in trials)
    surprises = np.concatenate([t.surprises() for t in trials])
    off = f"{1e3 * np.sqrt(np.mean(surprises**2)):.0f}" if len(surprises) else "-"
    return (
        f"| {label} | {maps} | {len(trials)} | {contacts} | {len(reached)} | {times} | "
        f"{errors} | {gap:.0f} | {off} |"
    )


def picture(file: Path, trials: Sequence[Trial]) -> None:
    """Draw all trajectories, one map a panel."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Circle

    maps = list(dict.fromkeys(t.run.scenario.name for t in trials))
    labels = list(dict.fromkeys(t.label for t in trials))
    columns = min(5, len(maps))
    rows = -(-len(maps) // columns)
    with style():
        figure = Figure(figsize=(3.4 * columns, 3.5 * rows + 0.5), dpi=110)
        for i, name in enumerate(maps):
            own = [t for t in trials if t.run.scenario.name == name]
            scenario = own[0].run.scenario
            axes = figure.add_subplot(rows, columns, i + 1, aspect="equal")
            for kind, x, y, radius in scenario.ground_patches:
                axes.add_patch(
                    Circle(
                        (x, y), radius, color="0.85" if kind == "carpet" else "#cfe3f7", zorder=0
                    )
                )
            for c in scenario.circles:
                axes.add_patch(Circle((c.x, c.y), c.radius, color="0.25", zorder=2))
            axes.add_patch(
                Circle(scenario.start[:2], scenario.radius, fill=False, color="0.5", zorder=2)
            )
            axes.plot(
                *scenario.goal[:2], "x", color="red", markersize=8, markeredgewidth=2, zorder=5
            )
            for t in own:
                colour, line, _ = LINES[labels.index(t.label) % len(LINES)]
                axes.plot(
                    *t.run.path[:, :2].T, color=colour, linestyle=line, linewidth=0.9, zorder=3
                )
                if t.run.outcome is Outcome.COLLISION:
                    axes.plot(*t.run.path[-1, :2], "x", color=colour, markersize=6, zorder=6)
            x_min, y_min, x_max, y_max = scenario.bounds
            axes.set(xlim=(x_min, x_max), ylim=(y_min, y_max))
            axes.set_title(name.removeprefix("twin_"), fontsize=9)
            axes.tick_params(labelsize=7)
            if i % columns == 0:
                axes.set_ylabel("y [m]", fontsize=8)
            if i + columns >= len(maps):
                axes.set_xlabel("x [m]", fontsize=8)
        for k, label in enumerate(labels):
            colour, line, _ = LINES[k % len(LINES)]
            axes.plot([], [], color=colour, linestyle=line, label=label)
        figure.legend(loc="lower center", ncols=len(labels), frameon=False, fontsize=9)
        figure.tight_layout(rect=(0, 0.5 / (3.5 * rows + 0.5), 1, 1))
        figure.savefig(file)
