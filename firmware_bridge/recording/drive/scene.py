"""What a map shows in Foxglove: area, obstacles, goal and robot; and the margins of a plan."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from firmware_bridge.recording.drive import foxglove as fg
from firmware_bridge.recording.drive.foxglove import LOOP, ROBOT, Content, box, colour, entity, line
from firmware_bridge.recording.drive.schemas import Stepped
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.outlines import corners_of
from kmpc_lite.control.world.scene import Solid
from kmpc_lite.control.world.shapes import Wall
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

INK, GREY, BLUE, ORANGE, GREEN = "#222222", "#8a8a8a", "#0072b2", "#e69f00", "#009e73"
FLAT = 0.01  # height of what lies on the floor [m]
HEIGHT = 0.3  # of obstacles, as a multiple of the robot's diameter plus this [m]
LOW = 0.2  # height of the robot, as a multiple of its radius plus this [m]
NEAREST = 8  # so many obstacles are shown with a margin: the nearest to the plan
DISCS = 5  # so many places of a plan are shown with what the robot keeps around them
MOST_BOXES = 5000  # rectangles of a grid that are shown


def map_scene(time: int, scenario: Scenario) -> Content:
    """Show what stays: area, goal, polygons, walls and grid, and the robot's body."""
    x_min, y_min, x_max, y_max = scenario.bounds
    corners = ((x_min, y_min), (x_max, y_min), (x_max, y_max), (x_min, y_max))
    radius, thin = scenario.radius, 0.1 * scenario.radius
    x, y, heading = scenario.goal
    green, blue = colour(GREEN, 0.6), colour(BLUE, 0.9)
    at_goal = _body(scenario, scenario.goal, radius, FLAT, green)
    body = _body(scenario, fg.ORIGIN, radius, LOW * radius + FLAT, blue)
    goal = [fg.arrow(x, y, heading, 2.0 * radius, green)]
    ahead = [fg.arrow(0.0, 0.0, 0.0, 1.4 * radius, blue)]
    found = [
        entity(time, "area", lines=[line(corners, thin, colour(INK), LOOP)]),
        entity(time, "goal", **at_goal, arrows=goal),
        entity(time, "robot", frame=ROBOT, **body, arrows=ahead),
    ]
    if scenario.solids is not None:
        height = HEIGHT * 2 * radius
        for k, solid in enumerate(scenario.solids.solids):
            found.append(_solid(time, f"obstacle {k}", solid, height, thin))
    return fg.scene(found)


def _body(
    scenario: Scenario, pose: Sequence[float], radius: float, height: float, paint: Content
) -> Content:
    """Parts of an entity: what a robot covers: a disc of a radius, or its outline."""
    if scenario.footprint is None:
        return {"cylinders": [fg.disc(pose[0], pose[1], radius, height, paint)]}
    corners = scenario.footprint.at(pose)
    return {"lines": [line(corners, 0.1 * scenario.radius, paint, LOOP, height)]}


def _solid(time: int, name: str, solid: Solid, height: float, thin: float) -> Content:
    """Show a polygon, a wall or a grid."""
    grey = colour(GREY)
    if isinstance(solid, Wall):
        (x1, y1), (x2, y2) = corners_of(solid)[:2]
        centre = ((x1 + x2) / 2, (y1 + y2) / 2, float(np.arctan2(y2 - y1, x2 - x1)))
        size = (solid.length + solid.thickness, max(solid.thickness, thin))
        return entity(time, name, cubes=[box(centre, size, height, grey)])
    if isinstance(solid, OccupancyGrid):
        rectangles = solid.rectangles[:MOST_BOXES]
        centres = solid.to_map(0.5 * (rectangles[:, :2] + rectangles[:, 2:]))
        heading = float(solid.origin[2])
        sizes = rectangles[:, 2:] - rectangles[:, :2]
        cubes = [
            box((*centre, heading), size, height, grey)
            for centre, size in zip(centres.tolist(), sizes.tolist(), strict=True)
        ]
        return entity(time, name, cubes=cubes)
    lines = [line(corners_of(solid), thin, grey, LOOP, z) for z in (0.0, height)]
    return entity(time, name, lines=lines)


def step_scene(time: int, scenario: Scenario, step: Stepped) -> Content:
    """Show what a step saw and keeps: circles, their margins, and the room that the plan takes."""
    grey, orange, radius = colour(GREY), colour(ORANGE, 0.25), scenario.radius
    height = HEIGHT * 2 * radius
    circles = [fg.disc(x, y, r, height, grey) for x, y, r, *_ in step.circles.tolist()]
    near, kept = margins_of(step.circles, step.plan.states, step.margins)
    rings = [
        fg.disc(x, y, r + margin, FLAT, orange)
        for (x, y, r, *_), margin in zip(step.circles[near].tolist(), kept.tolist(), strict=True)
    ]
    states = step.plan.states[1:]
    chosen = np.unique(np.linspace(0, len(states) - 1, DISCS).astype(int))
    taken = zip(states[chosen].tolist(), step.margins[chosen].tolist(), strict=True)
    room = [
        entity(time, f"room {k}", **_body(scenario, pose, radius + margin, FLAT, orange))
        for k, (pose, margin) in enumerate(taken)
    ]
    path = [line(step.path, 0.1 * radius, colour(GREEN))] if len(step.path) > 1 else []
    seen = entity(time, "circles", cylinders=circles)
    kept_off = entity(time, "margins", cylinders=rings)
    return fg.scene([seen, kept_off, *room, entity(time, "path", lines=path)])


def margins_of(circles: Array, states: Array, margins: Array) -> tuple[Array, Array]:
    """Margins that a plan keeps from the circles that are nearest to it.

    `circles`: (M, 5) [m, m/s]. `states`: (N + 1, 3) of the plan. `margins`: (N,) of its stages 1 to
    N [m]. Returns `near`, `kept`: numbers (K,) of the circles, and the margin of the stage that is
    nearest to each (K,) [m].
    """
    if not len(circles):
        return np.empty(0, dtype=int), np.empty(0)
    away = np.hypot(*(states[1:, None, :2] - circles[:, :2]).transpose(2, 0, 1)) - circles[:, 2]
    near = np.argsort(away.min(axis=0), kind="stable")[:NEAREST]
    return near, margins[away[:, near].argmin(axis=0)]
