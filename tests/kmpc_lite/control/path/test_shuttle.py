"""A robot that has stopped beside its goal comes back along the goal's axis."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from guided import GuideInUse

import kmpc_lite as kl

PROBLEM = kl.NavigationProblem()
GOAL = np.array([0.5, 0.2, 0.0])
NO_CIRCLES = np.empty((0, 5))
LENGTH = 0.3
"""How far a shuttle leads: two radii [m]."""


def stopped_at(pose: np.ndarray, guide: GuideInUse, circles: np.ndarray = NO_CIRCLES) -> None:
    """Let the guide see a robot that stands."""
    for _ in range(12):
        guide.reference(pose, GOAL, circles)


def test_beside_its_goal_a_robot_backs_up_and_comes_again() -> None:
    guide = GuideInUse(PROBLEM)
    stopped_at(GOAL + (0.0, 0.04, 0.02), guide)
    shuttle = guide.state.shuttle
    assert shuttle is not None
    np.testing.assert_allclose(np.abs(shuttle - GOAL), (LENGTH, 0.0, 0.0), atol=1e-12)
    assert guide.state.path is not None
    # once it is there, the path leads to the goal again, hardly turning
    guide.reference(shuttle + (0.0, 0.01, 0.0), GOAL, NO_CIRCLES)
    assert guide.state.shuttle is None
    path = guide.state.path
    np.testing.assert_allclose(path.poses[-1], GOAL, atol=1e-9)
    assert np.abs(np.diff(path.poses[:, 2])).sum() < 0.2


def test_a_robot_that_is_far_or_must_turn_anyway_drives_straight() -> None:
    for pose in (GOAL + (-1.2, 0.05, 0.0), GOAL + (-0.1, 0.0, 0.0)):
        guide = GuideInUse(PROBLEM)
        stopped_at(pose, guide)
        assert guide.state.shuttles == 0


def test_there_is_no_shuttle_without_reverse() -> None:
    guide = GuideInUse(replace(PROBLEM, u_min=(0.0, -np.pi / 4)))
    stopped_at(GOAL + (0.0, 0.04, 0.02), guide)
    assert guide.state.shuttles == 0


def test_it_must_be_quicker_than_turning_on_the_spot_by_a_second() -> None:
    for aside, begun in ((0.18, 1), (0.19, 0)):
        guide = GuideInUse(PROBLEM)
        stopped_at(GOAL + (0.0, aside, 0.0), guide)
        assert guide.state.shuttles == begun


def test_it_turns_back_within_half_a_radius_of_its_end() -> None:
    for off, turned in ((0.0749, True), (0.0751, False)):
        guide = GuideInUse(PROBLEM)
        stopped_at(GOAL + (0.0, 0.04, 0.02), guide)
        assert guide.state.shuttle is not None
        guide.reference(guide.state.shuttle + (0.0, off, 0.0), GOAL, NO_CIRCLES)
        assert (guide.state.shuttle is None) is turned


def test_it_turns_back_on_the_free_side() -> None:
    both = []
    for side in (-1.0, 1.0):
        guide = GuideInUse(PROBLEM)
        x, y = GOAL[:2] + (side * (LENGTH + 0.1), 0.0)
        stopped_at(GOAL + (0.0, 0.04, 0.02), guide, np.array([[x, y, 0.1, 0.0, 0.0]]))
        assert guide.state.shuttle is not None
        both.append(guide.state.shuttle[0] - GOAL[0])
    assert both == pytest.approx([LENGTH, -LENGTH])


def test_it_is_tried_three_times_for_one_goal() -> None:
    guide, beside, begun = GuideInUse(PROBLEM), GOAL + (0.0, 0.04, 0.02), 0
    for _ in range(5):
        stopped_at(beside, guide)
        if guide.state.shuttle is not None:
            begun += 1
            guide.reference(guide.state.shuttle, GOAL, NO_CIRCLES)
    assert begun == 3
