"""What maps are made of: area, obstacles, footprints."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from kmpc_lab.report.map_labels import TALLEST, Labels, write
from kmpc_lab.report.solid_parts import draw_solids
from kmpc_lab.report.style import BLUE, GREEN, INK, RED, WIDTH, new_figure
from kmpc_lite.control.world.circles import Circle
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def map_axes(view: Array) -> tuple[Figure, Any]:
    """Figure and axes for `view`, [[xmin, ymin], [xmax, ymax]] [m], to equal scales."""
    width, height = view[1] - view[0]
    figure = new_figure(float(np.clip((WIDTH - 0.9) * height / width, 1.2, TALLEST)) + 1.05)
    axes = figure.subplots()
    axes.set(
        xlim=view[:, 0],
        ylim=view[:, 1],
        aspect="equal",
        xlabel="x, east [m]",
        ylabel="y, north [m]",
    )
    axes.locator_params(nbins=8, steps=[1, 2, 5, 10])
    return figure, axes


def draw_scenario(axes: Any, scenario: Scenario, times: Array, labels: Labels) -> list[Any]:
    """Draw area, obstacles and goal; returns their legend entries.

    Moving obstacles are drawn at the start and at `times` [s].
    """
    from matplotlib.lines import Line2D

    handles = [_draw_area(axes, scenario, labels)]
    dot: dict[str, Any] = {
        "linestyle": "none",
        "marker": "o",
        "markersize": 9,
        "markeredgecolor": INK,
    }
    still = [c for c in scenario.circles if not (c.vx or c.vy)]
    moving = [c for c in scenario.circles if c.vx or c.vy]
    for circle in still:
        disc(
            axes,
            circle[:2],
            circle.radius,
            facecolor="#a9a9a9",
            edgecolor=INK,
            linewidth=0.9,
            zorder=2,
        )
        labels.avoid(circle[:2], circle.radius)
    if scenario.solids is not None:
        draw_solids(axes, scenario.solids.solids, labels)
    for circle in moving:
        _draw_moving(axes, circle, times, labels)
    if still or scenario.solids is not None:
        handles.append(Line2D([], [], markerfacecolor="#a9a9a9", label="obstacle", **dot))
    if moving:
        handles.append(
            Line2D([], [], markerfacecolor="#e4e4e4", label="moving, at the start", **dot)
        )
    handles.append(_draw_goal(axes, scenario, labels))
    return handles


def _draw_area(axes: Any, scenario: Scenario, labels: Labels) -> Any:
    """Draw the sides of the area; returns their legend entry."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Rectangle

    x_min, y_min, x_max, y_max = scenario.bounds
    side: dict[str, Any] = {"linewidth": 1.2, "linestyle": "-."}
    axes.add_patch(
        Rectangle(
            (x_min, y_min),
            x_max - x_min,
            y_max - y_min,
            fill=False,
            edgecolor=INK,
            zorder=1,
            **side,
        )
    )
    along = np.linspace(0.0, 1.0, 50)[:, None]
    corners = np.array(
        [(x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max), (x_min, y_min)]
    )
    labels.avoid_lines(
        np.concatenate(
            [(1.0 - along) * a + along * b for a, b in zip(corners[:-1], corners[1:], strict=True)]
        )
    )
    return Line2D([], [], color=INK, label="area bounds", **side)


def _draw_goal(axes: Any, scenario: Scenario, labels: Labels) -> Any:
    """Draw the goal, its tolerance and its heading; returns their legend entry."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    goal = np.array(scenario.goal)
    look: dict[str, Any] = {
        "fill": False,
        "edgecolor": GREEN,
        "linewidth": 1.6,
        "linestyle": "--",
        "zorder": 5,
    }
    if scenario.footprint is None:
        disc(axes, goal, scenario.radius, **look)
    else:
        axes.add_patch(Polygon(scenario.footprint.at(goal), closed=True, **look))
    disc(axes, goal, scenario.tolerance, facecolor=GREEN, alpha=0.45, edgecolor="none", zorder=3)
    _arrow(axes, goal, goal_front(scenario), GREEN, 1.8)
    labels.avoid(goal, scenario.radius)
    labels.avoid(goal_front(scenario), 0.2 * scenario.radius)
    return Line2D(
        [],
        [],
        color=GREEN,
        marker="o",
        markerfacecolor="none",
        linestyle="none",
        markersize=9,
        label="goal pose",
    )


def goal_front(scenario: Scenario) -> Array:
    """Give the tip (2,) of the arrow that shows the goal's heading."""
    tip: Array = np.array(scenario.goal[:2]) + 1.6 * scenario.radius * np.array(
        [np.cos(scenario.goal[2]), np.sin(scenario.goal[2])]
    )
    return tip


def _draw_moving(axes: Any, circle: Circle, times: Array, labels: Labels) -> None:
    """Draw a moving circle: filled at its start, outlined at `times`, its track with an arrow.

    Times at which outlines would overlap are left out.
    """
    centre, velocity = np.array(circle[:2]), np.array(circle[3:])
    speed = float(np.hypot(*velocity))
    disc(
        axes,
        centre,
        circle.radius,
        facecolor="#e4e4e4",
        edgecolor=INK,
        hatch="///",
        linewidth=0.9,
        zorder=2,
    )
    labels.avoid(centre, circle.radius)
    end = last = float(times[-1])
    # from the end back, so that the last outline is always there
    for time in times[::-1]:
        if time == end or min(time, last - time) * speed >= 0.9 * circle.radius:
            last, point = float(time), centre + time * velocity
            disc(
                axes,
                point,
                circle.radius,
                fill=False,
                edgecolor="#555555",
                linewidth=0.9,
                linestyle=":",
                zorder=2.4,
            )
            write(axes, point, f"{time:.4g} s", fontsize=7, color="#444444")
            labels.avoid(point, circle.radius)
    _arrow(axes, centre, centre + (end + 1.5 * circle.radius / speed) * velocity, "#555555", 0.9)


def disc(axes: Any, centre: Any, radius: float, **look: Any) -> None:
    """Circle to scale."""
    from matplotlib.patches import Circle as Patch

    axes.add_patch(Patch((float(centre[0]), float(centre[1])), radius, **look))


def footprint(axes: Any, pose: Array, scenario: Scenario, strong: bool) -> None:
    """Robot to scale at a pose (3,), with a line from there to its front."""
    from matplotlib.patches import Circle, Polygon

    front = scenario.radius
    for look in (
        {"facecolor": "#cfe4f3", "alpha": 0.75 if strong else 0.5, "edgecolor": "none"},
        {"fill": False, "edgecolor": BLUE, "linewidth": 1.5 if strong else 0.9},
    ):
        look["zorder"] = 4.5 if "fill" in look else 3.5
        if scenario.footprint is None:
            axes.add_patch(Circle((float(pose[0]), float(pose[1])), scenario.radius, **look))
        else:
            axes.add_patch(Polygon(scenario.footprint.at(pose), closed=True, **look))
            front = float(scenario.footprint.outline[:, 0].max())
    tip = pose[:2] + front * np.array([np.cos(pose[2]), np.sin(pose[2])])
    axes.plot(
        [pose[0], tip[0]],
        [pose[1], tip[1]],
        color=INK,
        linewidth=1.8 if strong else 1.2,
        zorder=5,
        solid_capstyle="butt",
    )


def cross(axes: Any, point: Array) -> None:
    """Mark a collision."""
    axes.plot(*point, "X", color=RED, markeredgecolor="white", markersize=11, zorder=7)


def _arrow(axes: Any, start: Any, end: Any, colour: str, width: float) -> None:
    from matplotlib.patches import FancyArrowPatch

    ends = [(float(p[0]), float(p[1])) for p in (start, end)]
    axes.add_patch(
        FancyArrowPatch(
            *ends,
            arrowstyle="-|>",
            mutation_scale=9,
            shrinkA=0,
            shrinkB=0,
            color=colour,
            linewidth=width,
            zorder=5.5,
        )
    )
