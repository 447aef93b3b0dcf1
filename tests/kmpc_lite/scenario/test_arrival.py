"""What counts as arrived, in one place."""

import numpy as np
import pytest

from kmpc_lab.sim.maps.families import random_map
from kmpc_lite.scenario.arrival import ARRIVED, Tolerance, in_pose
from kmpc_lite.scenario.files import Scenario


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


def test_a_scenario_that_says_nothing_else_has_the_papers():
    said = Scenario("a", (-1.0, -1.0, 1.0, 1.0), (), 0.1, (0.0, 0.0, 0.0), (0.5, 0.0, 0.0))
    assert said.arrival == ARRIVED == random_map("dense", 1).arrival


def test_noisy_poses_widen_what_counts_as_in_pose():
    assert in_pose(0.5, np.zeros(3)) == Tolerance(0.05, 0.1)
    assert in_pose(0.5, np.array([0.02, 0.02, 0.05])) == Tolerance(0.06, 0.15000000000000002)
