"""What a page is shown of a map, a pose and a plan: plain data, made beside the driving loop."""

from __future__ import annotations

import base64
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.live.channel import Packet
from firmware_bridge.recording.drive.seen import counted, hits, outline
from kmpc_lite.control.insight import Insight, insight
from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.controller import Controller
    from kmpc_lite.control.world.scan import LaserScan
    from kmpc_lite.scenario.files import Scenario

MOST_CIRCLES, MOST_POSES = 300, 300
"""Obstacles, the nearest, and poses of a path that are shown: a page draws no more in time."""
MOST_BEAMS = 720  # beams of a scan that are shown
MOST_SOLIDS, MOST_CELLS = 400, 256
"""Polygons and walls that are shown, and cells of a grid along each side."""
FREE, OCCUPIED, UNKNOWN = 0, 1, 2  # cells of a grid, as the page reads them


class LastStep(NamedTuple):
    """What the thread that plans leaves for others, in one assignment; nothing in it changes."""

    pose: tuple[float, float, float]
    plan: Plan
    insight: Insight  # path and margins behind it
    scan: LaserScan | None = None
    """What counted of the scan that it was made from, for a robot with a lidar."""


def last_step(
    controller: Controller, pose: ArrayLike, plan: Plan, scan: LaserScan | None = None
) -> LastStep:
    """Look at the plan that a controller has just made, in the thread that makes them."""
    x, y, theta = np.asarray(pose, dtype=float).tolist()
    seen = None if scan is None else counted(controller, scan)
    return LastStep((x, y, theta), plan, insight(controller, plan), seen)


def numbers(values: Array) -> bytes:
    """Pack an array as a channel takes it."""
    return np.ascontiguousarray(values, dtype=np.float64).tobytes()


def map_packet(scenario: Scenario, title: str) -> Packet:
    """Give what does not change: area, robot, goal, polygons, walls and grid."""
    outlined = scenario.footprint
    packet: Packet = {
        "title": title,
        "bounds": list(scenario.bounds),
        "radius": scenario.radius,
        "outline": outlined and numbers(outlined.outline),
        "goal": list(scenario.goal),
        "tolerance": scenario.tolerance,
        "polygons": [numbers(np.asarray(p.vertices)) for p in scenario.polygons[:MOST_SOLIDS]],
        "walls": [
            numbers(_corners(w.x1, w.y1, w.x2, w.y2, w.thickness))
            for w in scenario.walls[:MOST_SOLIDS]
        ],
    }
    if scenario.grid is not None:
        grid = scenario.grid
        cells, step = _thinned(grid.occupied, grid.unknown)
        x, y, theta = grid.origin
        packet["grid"] = {
            "x": x,
            "y": y,
            "theta": theta,
            "resolution": grid.resolution * step,
            "width": cells.shape[1],
            "height": cells.shape[0],
            "cells": base64.b64encode(cells.tobytes()).decode(),
        }
    return packet


def plan_packet(step: LastStep, goal: Sequence[float]) -> Packet:
    """Give what a plan leads along and past, and how it came about."""
    plan, scan = step.plan, step.scan
    clearance = plan.around.clearance(np.array([step.pose]))
    return {
        "plan": numbers(plan.states),
        "path": numbers(_thinned_path(step.insight.path[:, :2])),
        "margins": numbers(step.insight.margins),
        "circles": numbers(nearest_circles(step)),
        "scan": None if scan is None else numbers(_placed(hits(scan, MOST_BEAMS), step.pose)),
        "seen": None if scan is None else numbers(_placed(outline(scan), step.pose)),
        "distance": math.dist(step.pose[:2], tuple(goal)[:2]),
        "clearance": clearance if math.isfinite(clearance) else None,
        "status": plan.status.name,
        "goal": list(goal),
        "progress": _progress(plan),
        "reason": plan.reason,
    }


def nearest_circles(step: LastStep) -> Array:
    """Circles (M, 5) that a plan drives past; of many, the nearest to the robot."""
    circles: Array = step.plan.around.circles
    if len(circles) > MOST_CIRCLES:
        away = np.hypot(circles[:, 0] - step.pose[0], circles[:, 1] - step.pose[1])
        circles = circles[np.argsort(away - circles[:, 2])[:MOST_CIRCLES]]
    return circles


def _progress(plan: Plan) -> str:
    """What the robot does about its goal, and about which goal of a route."""
    number, count = plan.leg
    return plan.progress.name + (f", goal {number} of {count}" if count > 1 else "")


def _placed(points: Array, pose: tuple[float, float, float]) -> Array:
    """Points (B, 2) of the robot's frame on the map [m]."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    turned: Array = points @ np.array([[cos, sin], [-sin, cos]]) + np.array(pose[:2])
    return turned


def _thinned_path(path: Array) -> Array:
    """Points of a path (K, 2), at most `MOST_POSES` and the last."""
    every = max(1, -(-len(path) // MOST_POSES))
    return np.vstack([path[::every], path[-1:]])


def _corners(x1: float, y1: float, x2: float, y2: float, thickness: float) -> Array:
    """Corners (4, 2) of a wall."""
    along = np.array([x2 - x1, y2 - y1])
    length = float(np.hypot(*along)) or 1.0
    aside = 0.5 * thickness / length * np.array([-along[1], along[0]])
    ends = np.array([[x1, y1], [x2, y2]])
    return np.vstack([ends + aside, ends[::-1] - aside])


def _thinned(occupied: Array, unknown: Array) -> tuple[Array, int]:
    """Cells of a grid, so many of them made one that few are left; and how many along a side."""
    step = -(-max(occupied.shape) // MOST_CELLS)
    cells = np.where(unknown, UNKNOWN, np.where(occupied, OCCUPIED, FREE)).astype(np.uint8)
    if step == 1:
        return cells, 1
    height, width = (-(-side // step) for side in cells.shape)
    padded = np.full((height * step, width * step), FREE, dtype=np.uint8)
    padded[: cells.shape[0], : cells.shape[1]] = cells
    blocks = padded.reshape(height, step, width, step)
    full = (blocks == OCCUPIED).any(axis=(1, 3))
    hidden = (blocks == UNKNOWN).any(axis=(1, 3))
    return np.where(full, OCCUPIED, np.where(hidden, UNKNOWN, FREE)).astype(np.uint8), step
