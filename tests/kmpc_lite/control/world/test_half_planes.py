"""Obstacles and sides of the area as the half-planes that the QP keeps a robot out of."""

from __future__ import annotations

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.world.half_planes import KeepOut
from kmpc_lite.control.world.solids import Solids

SQUARE = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)]


def test_solids_stand_between_circles_and_sides() -> None:
    problem = kl.NavigationProblem(horizon=3)
    keep_out = KeepOut(problem, slots=8)
    solids = Solids([kl.Polygon(SQUARE), kl.Wall(-1, -1, -1, 1, 0.2)]).whole
    states = np.array([[-0.5, 0.5, 0.0], [-0.4, 0.5, 0.0], [-0.3, 0.5, 0.0], [-0.2, 0.5, 0.0]])
    circles = things_of(np.array([[-0.3, 1.5, 0.1, 0.0, 0.0]]))
    found = keep_out.clearances(states, circles, solids)
    assert found.obstacle_count == 3
    gaps, normals = found.values, found.normals
    assert gaps.shape == (3, 7)
    np.testing.assert_allclose(gaps[:, 1], [0.25, 0.15, 0.05])
    np.testing.assert_allclose(gaps[:, 2], [0.35, 0.45, 0.55])
    np.testing.assert_allclose(normals[:, 1], [[-1, 0]] * 3, atol=1e-12)
