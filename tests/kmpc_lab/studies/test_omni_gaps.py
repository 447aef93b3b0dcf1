"""Omnis get into slots and through doors, and the study would see it if they touched."""

import numpy as np
import pytest

from kmpc_lab.studies.omni_gaps import ROBOTS, drive, gaps_of, scene_of


@pytest.mark.parametrize("kind", ROBOTS)
def test_it_arrives_and_a_touch_would_be_seen(kind: str) -> None:
    row = drive(kind, 1)
    assert row.arrived and not row.collided
    _, goal, solids = scene_of(kind, 1)
    beside = goal + (0.2, 0.0, 0.0) if kind == "sideways" else np.array((0.2, 0.0, 0.0))
    assert gaps_of(ROBOTS[kind], solids)(np.stack([goal, beside])).tolist()[1] < 0.0
