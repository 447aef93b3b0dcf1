"""What the guide remembers is data: a copy of it goes on as the original does, in a search too."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from guided import GuideInUse

import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.world.circles import circles_to_array
from kmpc_lite.control.world.solids import Solids

PROBLEM = kl.NavigationProblem(**AREA, margin=0.02)
START, GOAL = np.array([-1.5, -0.2, 0.3]), np.array([1.5, 0.3, -1.0])


def pickled(value: Any) -> Any:
    return pickle.loads(pickle.dumps(value))


def ragged_wall() -> kl.OccupancyGrid:
    """As a lidar leaves it: with so many rectangles that paths are looked for on a lattice."""
    random, cells = np.random.default_rng(0), np.zeros((80, 80), dtype=bool)
    for row in range(80):
        if not 50 <= row < 66:
            cells[row, 38 - row // 20 : 42 + random.integers(0, 4)] = True
    return kl.OccupancyGrid(cells, 0.05, (-2.0, -2.0, 0.0))


def scenes() -> dict[str, tuple[np.ndarray, Solids | None]]:
    some = circles_to_array(
        [kl.Circle(0, 0, 0.3), kl.Circle(0.4, 0.6, 0.2), kl.Circle(-0.6, 1, 0.3)]
    )
    moving = circles_to_array([kl.Circle(0, 0, 0.3), kl.Circle(-0.8, -1.2, 0.2, 0.05, -0.05)])
    walls = Solids(
        [kl.Wall(0.0, -0.4, 0.0, 1.0, 0.05), kl.Polygon([(0.5, 0), (0.9, 0), (0.7, 0.4)])]
    )
    none = np.empty((0, 5))
    return {
        "circles": (some, None),
        "moving": (moving, None),
        "solids": (none, walls),
        "grid": (none, Solids([ragged_wall()])),
    }


def drive(guide: GuideInUse, circles: np.ndarray, solids: Solids | None, steps: range) -> list[Any]:
    """Follow the reference with a jump off the path now and then, so that paths are looked for."""
    answers = []
    for k in steps:
        seen = circles.copy()
        seen[:, :2] += 0.1 * k * seen[:, 3:]
        guidance = guide.reference(guide.robot, GOAL, seen, solids=solids)
        answers.append(guidance)
        guide.robot = guidance.states[1].copy()
        if k % 11 == 4:
            guide.robot[:2] += 0.2 * np.array([np.sin(k), np.cos(k)])
    return answers


@pytest.mark.parametrize("duplicate", [copy.deepcopy, pickled])
@pytest.mark.parametrize("name", ["circles", "moving", "solids", "grid"])
def test_a_copy_goes_on_to_the_last_bit(name: str, duplicate: Callable[[Any], Any]) -> None:
    circles, solids = scenes()[name]
    slow = GuidanceOptions(hurried_parts=1)
    guide, parts = GuideInUse(PROBLEM, options=slow), set()
    guide.robot = START.copy()
    for k in range(40):
        drive(guide, circles, solids, range(k, k + 1))
        parts.add(0 if guide.state.search is None else guide.state.search.parts)
        other = GuideInUse(PROBLEM, options=slow)
        other.state, other.robot = duplicate(guide.state), guide.robot.copy()
        original = GuideInUse(PROBLEM, options=slow)
        original.state, original.robot = copy.deepcopy(guide.state), guide.robot.copy()
        ahead = range(k + 1, k + 5)
        pairs = zip(
            drive(original, circles, solids, ahead),
            drive(other, circles, solids, ahead),
            strict=True,
        )
        for one, two in pairs:
            assert np.array_equal(one.states, two.states) and np.array_equal(one.path, two.path)
            assert (one.refreshed, one.switched) == (two.refreshed, two.switched)
    # between all parts of a search
    assert set(range(9 if name == "grid" else 6)) <= parts


def test_a_state_shares_nothing_with_its_copy() -> None:
    circles, solids = scenes()["grid"]
    guide = GuideInUse(PROBLEM)
    guide.robot = START.copy()
    drive(guide, circles, solids, range(6))
    kept = pickle.dumps(guide.state)
    other = GuideInUse(PROBLEM)
    other.state, other.robot = copy.deepcopy(guide.state), guide.robot.copy()
    drive(other, *scenes()["grid"], range(6, 30))
    assert pickle.dumps(guide.state) == kept
