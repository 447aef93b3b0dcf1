"""What counts as arrived, in one place."""

import numpy as np
import pytest

from kmpc_lite.scenario.arrival import ARRIVED, Tolerance


def test_a_robot_is_there_where_both_its_place_and_its_heading_are():
    goal = np.array([1.0, -2.0, np.pi])
    poses = goal + [(0.0, 0.0, 0.0), (0.03, 0.03, 0.1), (0.04, 0.04, 0.0), (0.0, 0.0, 0.2)]
    assert ARRIVED.met(poses, goal).tolist() == [True, True, False, False]
    assert [bool(ARRIVED.met(pose, goal)) for pose in poses] == [True, True, False, False]


@pytest.mark.parametrize("turns", [-3, -1, 1, 2])
def test_headings_are_compared_within_one_turn(turns):
    goal = np.array([0.0, 0.0, -3.1])
    there = np.array([0.0, 0.0, 3.1 + 2 * np.pi * turns])
    assert ARRIVED.met(there, goal)
    assert not Tolerance(1.0, 0.08).met(there, goal)
