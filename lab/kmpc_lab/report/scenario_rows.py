"""What was driven, as rows of a name and a value: map, robot, disturbances, changed options."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from kmpc_lab.report.words import angle, length, milliseconds
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.control.options import ControllerOptions
from kmpc_lite.control.wheels import Car, Omni
from kmpc_lite.scenario.files import Scenario

LISTED = 12
"""Circles, and changes of the floor, that have a row of their own; the others stand in the file
below."""
SCENARIOS_OWN, LEARNED = "slip", "learned"
"""Plants of ``kmpc simulate``; a run that tells none drove the scenario's own."""


def scenario_rows(run: Run) -> Iterable[tuple[str, str]]:
    """Map and task."""
    scenario = run.scenario
    x_min, y_min, x_max, y_max = scenario.bounds
    yield "Name", scenario.name
    yield (
        "Area of the robot's centre",
        f"x from {x_min:g} to {x_max:g} m, y from {y_min:g} to {y_max:g} m",
    )
    for name, pose in (("Start", scenario.start), ("Goal", scenario.goal)):
        yield name, f"({pose[0]:g}, {pose[1]:g}) m, heading {angle(pose[2])}"
    yield "Obstacles", str(scenario.obstacle_count)
    for i, circle in enumerate(scenario.circles[:LISTED], start=1):
        moves = f", moves at ({circle.vx:g}, {circle.vy:g}) m/s" if circle.vx or circle.vy else ""
        yield (
            f"Obstacle {i}",
            f"at ({circle.x:g}, {circle.y:g}) m, radius {length(circle.radius)}{moves}",
        )
    if len(scenario.circles) > LISTED:
        yield "Other circles", f"{len(scenario.circles) - LISTED}, in the file below"
    if scenario.solids is not None:
        grid = f", {scenario.grid!r}" if scenario.grid is not None else ""
        yield (
            "Solids",
            f"polygons {len(scenario.polygons)}, walls {len(scenario.walls)}{grid}; "
            "in the file below",
        )
    yield "Margin asked for", length(scenario.margin)
    yield "Period and horizon", f"{milliseconds(run.dt)}, {run.plans.shape[1] - 1} stages"


def robot_rows(run: Run) -> Iterable[tuple[str, str]]:
    """The robot and its conditions; of the scenario's only those that were in force in this run."""
    scenario = run.scenario
    plant = str(run.info.get("plant", SCENARIOS_OWN))
    kinds = {
        SCENARIOS_OWN: "simulated, with the slip, lag and floor below",
        LEARNED: (
            "simulated: behaves as the model does, lag and noise included; "
            "the scenario's slip, lag and floors do not act"
        ),
    }
    yield "Robot", kinds.get(plant, f"{plant}; the scenario's [plant] does not act")
    if scenario.footprint is None:
        yield "Radius", length(scenario.radius)
    else:
        corners = ", ".join(f"({x:g}, {y:g})" for x, y in scenario.footprint.corners)
        yield "Footprint", f"{corners} m about the pose"
    if scenario.du_max is not None:
        yield (
            "Commands change by at most",
            f"{scenario.du_max[0]:g} m/s², {scenario.du_max[1]:g} rad/s²",
        )
    if isinstance(scenario.wheels, Car):
        yield "Wheels", f"steered, turning radius {length(scenario.wheels.turning_radius)}"
    elif isinstance(scenario.wheels, Omni):
        yield "Wheels", "drive sideways, too; what is shown is the speed ahead"
    elif isinstance(scenario.wheels, tuple):
        track, fastest = scenario.wheels
        yield "Wheels", f"{length(track)} apart, at most {fastest:g} m/s each"
    if plant not in kinds:
        return
    if plant == SCENARIOS_OWN:
        yield from _plant_rows(scenario)
    x, y, theta = scenario.pose_noise
    yield (
        "Noise of the measured pose",
        f"{length(x)}, {length(y)}, {theta:g} rad" if any(scenario.pose_noise) else "none",
    )
    yield "Age of the measured pose", _time(scenario.pose_age)
    yield "Seed", str(scenario.seed)


def _plant_rows(scenario: Scenario) -> Iterable[tuple[str, str]]:
    """Slip, turns, lag and changes of the floor."""
    yield "Mean slip", f"{100 * scenario.slip:g} %"
    yield "Share of a turn that happens", f"{100 * scenario.turn_gain:g} %"
    yield "Lag of the motors", f"{_time(scenario.lag)}{' (time constant)' if scenario.lag else ''}"
    yield "Dead time before them", _time(scenario.dead_time)
    for floor in scenario.floors[:LISTED]:
        yield (
            f"Floor from {floor.time:g} s on",
            f"mean slip {100 * floor.slip:g} %, {100 * floor.turn_gain:g} % of a turn happens",
        )
    if len(scenario.floors) > LISTED:
        yield "Other floors", f"{len(scenario.floors) - LISTED}, in the file below"
    if not scenario.floors:
        yield "Changes of the floor", "none"
    if any(scenario.turning_point):
        ahead, left = scenario.turning_point
        yield (
            "Turns about a point",
            f"{length(ahead)} ahead of its centre, {length(left)} to the left",
        )


def _time(seconds: float) -> str:
    return milliseconds(seconds) if seconds else "none"


def option_rows(run: Run) -> Iterable[tuple[str, str]]:
    """Options that are not the usual ones, with the usual ones beside them."""
    changed = run.info.get("options", run.scenario.options.changed())
    if isinstance(changed, Mapping):
        yield from _rows("", changed, ControllerOptions())


def _rows(where: str, changed: Mapping[str, Any], usual: Any) -> Iterable[tuple[str, str]]:
    """Rows of a table and of the tables in it."""
    for name, value in changed.items():
        before = getattr(usual, name, None)
        if isinstance(value, Mapping):
            yield from _rows(f"{where}{name}.", value, before)
            continue
        yield f"Option {where}{name}", f"{_told(value)}, usually {_told(before)}"


def _told(value: Any) -> str:
    if isinstance(value, list | tuple):
        return f"[{', '.join(_told(each) for each in value)}]"
    number = isinstance(value, float)
    return f"{value:g}" if number else str(value)
