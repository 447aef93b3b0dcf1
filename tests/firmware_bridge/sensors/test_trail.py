"""Where the robot was, between poses and shortly behind them."""

import math

import numpy as np
import pytest

from firmware_bridge.messages import State
from firmware_bridge.sensors.sight import AHEAD, Trail


def test_between_poses_it_is_interpolated_over_the_seam_of_the_heading_too():
    trail = Trail()
    trail.add(State(0.0, 0.0, 3.0, 0.0, 0.0, 10.0))
    trail.add(State(1.0, 2.0, -3.0, 0.0, 0.0, 10.2))
    (found,) = trail.poses(np.array([10.1]))
    assert found == pytest.approx([0.5, 1.0, math.pi], abs=1e-9)
    assert trail.poses(np.array([9.0]))[0] == pytest.approx([0.0, 0.0, 3.0])


def test_behind_the_last_it_goes_on_for_a_while():
    trail = Trail()
    trail.add(State(1.0, 0.0, 0.0, 0.5, 0.0, 10.0))
    found = trail.poses(np.array([10.1, 10.0 + 10 * AHEAD]))
    assert found[0] == pytest.approx([1.05, 0.0, 0.0]) and found[1, 0] == 1.0 + 0.5 * AHEAD


def test_bad_and_old_poses_are_not_remembered():
    trail = Trail()
    trail.add(None)
    trail.add(State(math.nan, 0.0, 0.0, 0.0, 0.0, 1.0))
    trail.add(State(1.0, 0.0, 0.0, math.nan, 0.0, 2.0))
    trail.add(State(9.0, 0.0, 0.0, 0.0, 0.0, 1.5))
    assert trail.poses(np.array([3.0])).tolist() == [[1.0, 0.0, 0.0]]
