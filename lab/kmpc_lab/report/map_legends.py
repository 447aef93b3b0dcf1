"""Legend entries of maps."""

from __future__ import annotations

from typing import Any

from kmpc_lab.report.style import BLUE, INK, LINES, ORANGE, RED

PLAN: dict[str, Any] = {"color": ORANGE, "linewidth": 1.4, "linestyle": (0, (4, 1.5))}
"""How the plan at a time is drawn."""


def robot_handles() -> list[Any]:
    """Legend entries of a single run: its path, a plan, the robot."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=BLUE, linewidth=2.8, label="driven path"),
        Line2D([], [], **PLAN, label="plan at that time"),
        Line2D(
            [],
            [],
            color=BLUE,
            marker="o",
            markerfacecolor="#cfe4f3",
            linestyle="none",
            markersize=9,
            label="robot, heading",
        ),
    ]


def series_handles(names: list[str], labels: list[str], counts: list[int]) -> list[Any]:
    """Legend entries: the runs' labels, and how runs ended (reached, collided, out of time)."""
    from matplotlib.lines import Line2D

    entries = []
    for i, name in enumerate(names):
        colour, line, marker = LINES[i % len(LINES)]
        count = labels.count(name)
        # a label that begins with an underscore would be left out of the legend
        text = (f" {name}" if name.startswith("_") else name) + (f" ({count})" if count > 1 else "")
        entries.append(
            Line2D([], [], color=colour, linestyle=line, marker=marker, markersize=5, label=text)
        )
    if counts[1]:
        entries.append(
            Line2D(
                [],
                [],
                color=RED,
                marker="X",
                markeredgecolor="white",
                linestyle="none",
                markersize=9,
                label="collision",
            )
        )
    if counts[2]:
        entries.append(
            Line2D(
                [],
                [],
                color=INK,
                marker="o",
                markerfacecolor="white",
                linestyle="none",
                markersize=5,
                label="out of time",
            )
        )
    return entries
