"""When the guide looks for a path again: for a reason, at once, and without flicker."""

import numpy as np
from guide_scenes import KEEP, NO_CIRCLES, PROBLEM, circles, pose
from guided import GuideInUse


def test_a_way_is_kept_while_nothing_changes() -> None:
    guide, x, scene = GuideInUse(PROBLEM), pose(-1.5, -0.1, 0), circles((0, 0, 0.3), (0.5, 1, 0.2))
    refreshed = []
    for _ in range(60):
        guidance = guide.reference(x, pose(1.5, 0, 0), scene)
        refreshed.append(guidance.refreshed)
        x = guidance.states[1].copy()
    assert refreshed[0] and sum(refreshed) <= 3


def test_a_new_goal_or_map_is_answered_at_once() -> None:
    guide, x = GuideInUse(PROBLEM), pose(-1.5, 0, 0)
    guide.reference(x, pose(1.5, 0, 0), NO_CIRCLES)
    assert not guide.reference(x, pose(1.5, 0, 0), NO_CIRCLES).refreshed
    assert guide.reference(x, pose(1.5, 0.5, 0), NO_CIRCLES).refreshed
    appeared = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.2, 0.3)))
    assert appeared.refreshed
    assert (np.hypot(appeared.path[:, 0], appeared.path[:, 1] - 0.2) >= 0.3 + KEEP - 1e-6).all()
    moved = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.3, 0.3)))
    assert moved.refreshed
    grown = guide.reference(x, pose(1.5, 0.5, 0), circles((0, 0.3, 0.4)))
    assert grown.refreshed


def test_a_circle_that_moves_as_foreseen_is_no_reason() -> None:
    guide, x, refreshed = GuideInUse(PROBLEM), pose(-1.5, 0, 0), []
    for k in range(10):
        # far from the way
        guidance = guide.reference(
            x, pose(1.5, 0, 0), circles((-1.0 + 0.02 * k, 1.7, 0.1, 0.2, 0.0))
        )
        refreshed.append(guidance.refreshed)
        x = guidance.states[1].copy()
    assert refreshed == [True] + [False] * 9


def test_the_side_does_not_flicker_when_both_are_as_good() -> None:
    random, guide, sides = np.random.default_rng(1), GuideInUse(PROBLEM), []
    for _ in range(45):
        # the circle shakes by more than is overlooked, so that a way is looked for every time
        scene = circles((0.0, 0.03 * random.normal(), 0.3))
        guidance = guide.reference(pose(-1.5, 0.01 * random.normal(), 0), pose(1.5, 0, 0), scene)
        sides.append(np.sign(guidance.path[np.abs(guidance.path[:, 0]).argmin(), 1]))
    assert len(set(sides)) == 1
