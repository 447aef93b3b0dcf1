"""Requests of paths, as the guide makes them."""

import numpy as np

from kmpc_lite.control.path.planner import PathRequest
from kmpc_lite.control.world.solids import Solids


def request(start, goal, circles=(), solids=None, footprint=None, area=2.0, turn=2.0):
    """Between two poses, of a robot of 0.15 m that drives 0.6 m/s."""
    outline = np.array([[0.0, 0.0, 0.15]])
    if footprint is not None:
        radii = np.full(len(footprint.circles), footprint.circle_radius)
        outline = np.column_stack([footprint.circles, radii])
    return PathRequest(
        start=np.array(start, dtype=float),
        goal=np.array(goal, dtype=float),
        target=np.array(goal, dtype=float),
        circles=np.array([(*c, 0, 0) for c in circles], dtype=float).reshape(-1, 5),
        solids=Solids(solids) if solids else None,
        outline=outline,
        inflation=float(outline[0, 2]),
        area=np.array([[-area, -area], [area, area]]),
        forward=np.array([0.6, turn]),
        backward=np.array([0.6, turn]),
    )


def found(planner, asked, quanta=1):
    """What a planner finds, its parts one after the other."""
    planner.begin(asked)
    while planner.path() is None:
        assert planner.advance(quanta) >= 1
    return planner.path()
