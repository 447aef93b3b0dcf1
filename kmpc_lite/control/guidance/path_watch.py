"""Whether what has become known lately stands on the path that is driven."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from kmpc_lite.control.guidance.situation import Situation
from kmpc_lite.control.guidance.state import GuideState
from kmpc_lite.control.guidance.timed_path import TimedPath
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.solids import Solids


def has_grown_elsewhere(
    state: GuideState, now: Situation, inflation: float, options: GuidanceOptions
) -> bool:
    """Whether the map is another one, which leaves the path free: then there is no hurry."""
    path, solids = state.path, now.solids
    if solids is state.solids or path is None or solids is None or state.solids is None:
        return False
    if state.urgent or state.turning or same_solids(solids, state.solids):
        return False
    same_circles = now.circles.tobytes() == state.circles_at_rest
    if now.target.tolist() != state.goal.tolist() or not same_circles:
        return False
    if path.drive_end - state.place > options.grid_step * options.lattice_nodes:
        return False  # more than can be looked at in a step
    points = points_ahead(state, now, path, inflation, options)
    return not len(points) or bool((solids.whole.least(points) >= inflation).all())


def points_ahead(
    state: GuideState, now: Situation, path: TimedPath, inflation: float, options: GuidanceOptions
) -> Array:
    """Points (n, 2) of the path that is left, but for those where the robot is and is to stand.

    There it may come as near to things as it must. Of a path longer than can be looked at in a step
    the beginning is given.
    """
    end = min(path.drive_end, state.place + options.grid_step * options.lattice_nodes)
    points = path.at(np.arange(state.place, end, options.grid_step))[:, :2]
    ends = [np.hypot(*(points - pose[:2]).T) for pose in (now.pose, now.goal)]
    ahead: Array = points[np.minimum(*ends) > inflation]
    return ahead


def same_solids(first: Solids | None, second: Solids | None) -> bool:
    """Whether two maps are one."""
    if first is second:
        return True
    return first is not None and second is not None and first.solids == second.solids
