"""Whether a scenario's robot can stand where it starts, and at its goal."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np

from kmpc_lite.control.footprint import Footprint
from kmpc_lite.errors import ScenarioError
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.scenario.files import Scenario


def check_place(
    scenario: Scenario, key: Literal["start", "goal"], pose: tuple[float, float, float]
) -> None:
    """Raise ScenarioError if the robot cannot stand at a pose (3,), its start or a goal."""
    x_min, y_min, x_max, y_max = scenario.bounds
    x, y, _ = pose
    where = f"{scenario.name}: [robot] {key}"
    if scenario.has_area and not (x_min <= x <= x_max and y_min <= y <= y_max):
        raise ScenarioError(
            f"{where}: ({x:g}, {y:g}) lies outside the bounds {list(scenario.bounds)}"
        )
    if scenario.footprint is not None:
        _check_footprint(scenario, scenario.footprint, key, np.array(pose))
        return
    for i, circle in enumerate(scenario.circles):
        distance = float(np.hypot(x - circle.x, y - circle.y))
        moving = circle.vx != 0.0 or circle.vy != 0.0
        if distance < circle.radius + scenario.radius and not (moving and key == "goal"):
            raise ScenarioError(
                f"{where}: ({x:g}, {y:g}) is {distance:g} m from the centre of circle {i}, "
                f"but the radii add up to {circle.radius + scenario.radius:g} m"
            )
    if scenario.solids is not None:
        gap = float(scenario.solids.whole.least(np.array([[x, y]]))[0])
        if gap < scenario.radius:
            raise ScenarioError(
                f"{where}: ({x:g}, {y:g}) is {gap:g} m from a polygon, wall or grid cell, "
                f"but the robot's radius is {scenario.radius:g} m"
            )


def _check_footprint(scenario: Scenario, footprint: Footprint, key: str, pose: Array) -> None:
    # here, since most robots are round
    from kmpc_lite.scenario.touch import footprint_gaps

    circles = [c for c in scenario.circles if key == "start" or not (c.vx or c.vy)]
    solids = () if scenario.solids is None else scenario.solids.solids
    rows = np.array(circles, dtype=float).reshape(1, -1, 5)
    gap = float(footprint_gaps(footprint, pose[None], rows, solids)[0])
    if gap < 0.0:
        raise ScenarioError(
            f"{scenario.name}: [robot] {key}: at ({pose[0]:g}, {pose[1]:g}, {pose[2]:g}) the "
            f"footprint overlaps an obstacle by {-gap:g} m"
        )
