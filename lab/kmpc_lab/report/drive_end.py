"""Where on the map a drive ended."""

from __future__ import annotations

import numpy as np

from kmpc_lab.report.words import substeps
from kmpc_lab.sim.closed_loop import Outcome, Run
from kmpc_lite.control.kernels.clearance import distances_and_directions, things_of
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
        distances, normals = (
            np.concatenate([distances, gaps], axis=1),
            np.concatenate([normals, away], axis=1),
        )
    hit = int(np.argmin(distances[0]))
    point: Array = here[0] - distances[0, hit] * normals[0, hit]
    return point
