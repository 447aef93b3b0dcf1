"""Omnis get into slots and through doors."""

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.drive import gaps_of
from kmpc_lab.studies.omni_gaps import ROBOTS, drive, scene_of


@pytest.mark.parametrize("kind", ROBOTS)
def test_it_arrives_and_a_touch_would_be_seen(kind: str) -> None:
    row, (start, _, solids) = drive(kind, 1), scene_of(kind, 1)
    assert row.arrived and not row.collided and row.clearance < 0.1
    inside = np.append(np.mean(solids[0].vertices, axis=0), 0.0)
    gaps = gaps_of(kl.NavigationProblem(footprint=ROBOTS[kind].footprint), solids)
    assert gaps(start[None])[0] > 0.0 > gaps(inside[None])[0]
