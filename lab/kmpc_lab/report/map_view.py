"""Which part of a map a picture shows, and where on it a drive ended."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from kmpc_lab.report.map_parts import goal_front
from kmpc_lab.report.solid_parts import solid_points
from kmpc_lab.report.words import substeps
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.control.kernels.clearance import distances_and_directions, things_of
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

NO_DISTANCES = np.empty((1, 0)), np.empty((1, 0, 2))


def end_index(run: Run) -> int:
    """Index in `Run.path` of the sub-sample at which the drive ended."""
    last = len(run.path) - 1
    return (
        min(int(round(run.duration / run.dt * substeps(run))), last)
        if run.outcome is Outcome.COLLISION
        else last
    )


def contact_point(run: Run, index: int) -> Array:
    """Give the point (2,) of the obstacle's edge that the robot ran into."""
    here, time = run.path[index : index + 1, :2], np.array([index * run.dt / substeps(run)])
    distances, normals = (
        distances_and_directions(things_of(run.scenario.circles_at(0.0)), here, time)
        if run.scenario.circles
        else NO_DISTANCES
    )
    if run.scenario.solids is not None:
        gaps, away = run.scenario.solids.whole.measure(here)
        distances = np.concatenate([distances, gaps], axis=1)
        normals = np.concatenate([normals, away], axis=1)
    hit = int(np.argmin(distances[0]))
    point: Array = here[0] - distances[0, hit] * normals[0, hit]
    return point


def view_of(scenario: Scenario, runs: Sequence[Run]) -> Array:
    """Rectangle of the map to show, [[xmin, ymin], [xmax, ymax]] [m].

    It holds all that was driven, and obstacles and area where they are near.
    """
    ends = np.array([scenario.start[:2], scenario.goal[:2], goal_front(scenario)])
    points = np.concatenate([*(run.path[:, :2] for run in runs), ends])
    low, high = points.min(axis=0) - scenario.radius, points.max(axis=0) + scenario.radius
    span = float((high - low).max())
    near_low, near_high = low - 0.35 * span, high + 0.35 * span
    for circle in scenario.circles:
        centre = np.array(circle[:2])
        if ((centre > near_low) & (centre < near_high)).all():
            low = np.minimum(low, centre - circle.radius)
            high = np.maximum(high, centre + circle.radius)
    if scenario.solids is not None:
        corners = solid_points(scenario.solids.solids)
        near = corners[((corners > near_low) & (corners < near_high)).all(axis=1)]
        if len(near):
            low, high = np.minimum(low, near.min(axis=0)), np.maximum(high, near.max(axis=0))
    area_low, area_high = np.array(scenario.bounds[:2]), np.array(scenario.bounds[2:])
    low = np.where(low - area_low <= 0.6 * span, np.minimum(area_low, low), low - 0.15 * span)
    high = np.where(area_high - high <= 0.6 * span, np.maximum(area_high, high), high + 0.15 * span)
    # a corridor gets some room above and below, or nothing could be written beside the robot
    pad = np.maximum(0.04 * (high - low).max(), 0.5 * (0.35 * (high - low).max() - (high - low)))
    return np.array([low - pad, high + pad])
