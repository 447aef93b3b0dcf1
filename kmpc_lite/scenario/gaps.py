"""How far a robot is from the nearest obstacle of a scenario."""

from __future__ import annotations

import numpy as np

from kmpc_lite.control.kernels.clearance import distances, things_of
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array


def obstacle_gaps(scenario: Scenario, poses: Array, times: Array) -> Array:
    """Distances (n,) from a robot at poses (n, 3) [m, m, rad] to its nearest obstacle.

    Obstacles stand where they are at times (n,) [s]; distances [m] are those between edges.
    """
    if scenario.footprint is None:
        return point_gaps(scenario, poses[:, :2], times) - scenario.radius
    # here, since most robots are round
    from kmpc_lite.scenario.touch import footprint_gaps

    circles = np.array([scenario.circles_at(time) for time in times.tolist()])
    solids = () if scenario.solids is None else scenario.solids.solids
    return footprint_gaps(scenario.footprint, poses, circles, solids)


def point_gaps(scenario: Scenario, points: Array, times: Array) -> Array:
    """Distances (n,) from points (n, 2) to the nearest obstacle at times (n,) [m], [s]."""
    gaps = np.full(len(points), np.inf)
    if scenario.circles:
        gaps = distances(things_of(scenario.circles_at(0.0)), points, times).min(axis=1)
    if scenario.solids is not None:
        gaps = np.minimum(gaps, scenario.solids.whole.least(points))
    return gaps
