"""Legend entries of maps, and labels that find their own place."""

from __future__ import annotations

from typing import Any

import numpy as np

from kmpc_lab.report.style import BLUE, INK, LINES, ORANGE, RED, SMALL, WIDTH
from kmpc_lite.types import Array

TALLEST = 7.0
"""Of a map's axes [in]."""


def write(axes: Any, where: Array, text: str, **look: Any) -> None:
    """Text in the middle of a place, with a white rim so that it stays legible on lines."""
    from matplotlib.patheffects import withStroke

    written = axes.text(*where, text, ha="center", va="center", zorder=8, clip_on=True, **look)
    written.set_path_effects([withStroke(linewidth=2.5, foreground="white")])


class Labels:
    """Puts short texts beside things, where the least lies under them.

    `axes`: written on. `view`: (2, 2) what they show [m]. `points`: (n, 2) of lines to stay away
    from [m].
    """

    def __init__(self, axes: Any, view: Array, points: Array) -> None:
        self._axes, self._view = axes, view
        width, height = view[1] - view[0]
        self._metres_per_point = float(width) / (72.0 * min(WIDTH - 0.9, TALLEST * width / height))
        self._points = points[:: max(1, len(points) // 300)]
        self._discs: list[tuple[Array, float]] = []

    def avoid(self, centre: Any, radius: float) -> None:
        """Keep later texts away from a disc."""
        self._discs.append((np.array(centre[:2], dtype=float), radius))

    def avoid_lines(self, points: Array) -> None:
        """Keep later texts away from points (n, 2) of lines."""
        self._points = np.concatenate([self._points, points[np.isfinite(points).all(axis=1)]])

    def put(self, text: str, centre: Any, radius: float, bold: bool = False) -> None:
        """Write beside a disc of `radius` [m] around `centre`."""
        letter = SMALL * self._metres_per_point
        half = np.array([0.32 * len(text), 0.55]) * letter
        point = np.array(centre[:2], dtype=float)
        best, where, leader = -np.inf, point, None
        for away in range(5):
            for direction in np.linspace(0.0, 2 * np.pi, 16, endpoint=False):
                unit = np.array([np.cos(direction), np.sin(direction)])
                # far enough that the text's box just stays outside the disc
                gap = (0.35 + 1.2 * away) * letter
                inside = float(np.min(half / np.maximum(np.abs(unit), 1e-9)))
                spot = point + (radius + gap + inside) * unit
                # a place farther off must be worth it
                merit = self._room(spot, half, 0.8 * letter) - 0.6 * away * letter
                if merit > best + 1e-9:
                    best, where = merit, spot
                    leader = (
                        np.array([point + radius * unit, point + (radius + gap) * unit])
                        if away
                        else None
                    )
        if leader is not None:
            self._axes.plot(leader[:, 0], leader[:, 1], color=INK, linewidth=0.8, zorder=6.5)
        write(self._axes, where, text, fontsize=SMALL, fontweight="bold" if bold else "normal")
        for x in (-0.6, 0.0, 0.6):
            self._discs.append((where + half * np.array([x, 0.0]), float(half[1])))

    def _room(self, spot: Array, half: Array, enough: float) -> float:
        """Distance [m] from a box of half sizes (2,) to the nearest thing, at most `enough`."""
        box = spot + half * np.array([[x, y] for x in (-1, -0.5, 0, 0.5, 1) for y in (-1, 0, 1)])
        if (box < self._view[0]).any() or (box > self._view[1]).any():
            return -np.inf
        free = float(
            np.min(np.hypot(*(self._points[:, None] - box).transpose(2, 0, 1)), initial=enough)
        )
        for other, size in self._discs:
            free = min(free, float(np.hypot(*(box - other).T).min()) - size)
        return free


PLAN: dict[str, Any] = {"color": ORANGE, "linewidth": 1.4, "linestyle": (0, (4, 1.5))}
"""How the plan at a time is drawn."""


def _marker(label: str, size: float = 9, **look: Any) -> Any:
    """Legend entry of a marker alone."""
    from matplotlib.lines import Line2D

    return Line2D([], [], linestyle="none", markersize=size, label=label, **look)


def robot_handles() -> list[Any]:
    """Legend entries of a single run: its path, a plan, the robot."""
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=BLUE, linewidth=2.8, label="driven path"),
        Line2D([], [], **PLAN, label="plan at that time"),
        _marker("robot, heading", color=BLUE, marker="o", markerfacecolor="#cfe4f3"),
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
        entries.append(_marker("collision", color=RED, marker="X", markeredgecolor="white"))
    if counts[2]:
        look = {"color": INK, "marker": "o", "markerfacecolor": "white"}
        entries.append(_marker("out of time", 5, **look))
    return entries
