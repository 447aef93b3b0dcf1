"""What the options of sight mean for the paper's robot, looked at on both sides of each number."""

import numpy as np
import pytest
from guided import GuideInUse
from seen_maps import hit_boxes

import kmpc_lite as kl
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.sight.local_map import LocalMap
from kmpc_lite.control.world.sight.sight import Sight
from kmpc_lite.control.world.sight.view import View
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.types import Array

SMALL = kl.NavigationProblem()
LARGE = kl.NavigationProblem(x_min=(-500.0, -500.0, -np.inf), x_max=(500.0, 500.0, np.inf))
HERE = np.zeros(3)
STEP = np.pi / 180


def sight(problem: kl.NavigationProblem = SMALL, **options: float) -> Sight:
    made = SightOptions(**options)  # type: ignore[arg-type]
    return Sight(problem, problem.scale, made, 3.0)


def scan(distance: float, reach: float = 5.0, **more: float) -> kl.LaserScan:
    return kl.LaserScan(np.full(360, distance), -np.pi, STEP, reach, **more)


def looked(problem: kl.NavigationProblem = SMALL, reach: float = 5.0, **more: float) -> LocalMap:
    found = sight(problem).look(None, [scan(2.0, reach, **more)], HERE, 0.0)
    assert found is not None
    return found


def test_a_surface_is_nearer_than_seen_by_two_standard_deviations() -> None:
    """Of a range that counts with its neighbours, and of the pose."""
    here = sight().look(None, [scan(1.0, noise=0.003)], HERE, 0.001)
    assert here is not None
    cells, _ = here.cells_of(np.array([[1.01, 0.01], [0.99, 0.01]]))
    chosen = np.isin(np.flatnonzero(here.state > 0), cells)
    nearest = hit_boxes(here)[0][chosen, 0].min()
    errors = 2.0 * np.hypot(0.003 / np.sqrt(2.0), 0.001)
    assert nearest == pytest.approx(np.cos(2.0 * STEP) - errors, abs=1e-6)


def test_nothing_emerges_from_what_is_not_seen_now() -> None:
    usual, wary = (sight(emerging_speed=speed) for speed in (0.0, 0.2))
    ahead = kl.LaserScan(np.full(90, 2.0), -np.pi / 4, STEP, 5.0)
    here: LocalMap | None = looked()
    for _ in range(3):
        here = usual.look(here, [ahead], HERE, 0.0)
    assert here is not None

    def dark(eyes: Sight) -> float:
        boxes = View(eyes, here, HERE)._unknown
        return float(sum((b.high - b.low).prod(axis=1).sum() for b in boxes))

    assert dark(sight()) == dark(usual) < dark(wary)


def test_nothing_is_known_of_what_stands_beside_a_robot_that_begins() -> None:
    """But what it covers itself, up to a cell; a scanner looks ahead."""
    ahead = kl.LaserScan(np.full(90, 2.0), -np.pi / 4, STEP, 5.0)

    def free_behind(eyes: Sight, pose: Array = HERE) -> float:
        here = eyes.look(None, [ahead], pose, 0.0)
        assert here is not None
        distance = np.arange(0.0, 1.0, 0.01)
        dark = here.is_unknown(np.stack([-distance, 0.0 * distance], axis=1))
        return float(distance[dark.argmax()])

    usual, trusting = free_behind(sight()), free_behind(sight(free_at_start=1.0))
    assert 0.15 <= usual < 0.22
    assert trusting == pytest.approx(usual + 0.15, abs=0.02)


class OneView:
    """What scans have shown: nothing on the path, and a map."""

    coarseness, is_narrow = 0.0, False

    def __init__(self, known: Solids | None = None) -> None:
        self._known, self.looks = known, 0

    def solids(self, given: Solids | None) -> Solids | None:
        return self._known

    def is_dark(self, points: Array, distance: float) -> Array:
        return np.zeros(len(points), dtype=bool)

    def unknown_cells(self) -> tuple[Array, Array, float]:
        return np.ones((1, 1), dtype=bool), np.zeros(2), 0.1

    def blind_turn(self, direction: float) -> float:
        return 0.0

    def blocks(self, points: Array, distance: float) -> bool:
        self.looks += 1
        return False


def test_a_path_is_looked_for_from_where_the_robot_will_be() -> None:
    guide, view, begun = GuideInUse(LARGE), OneView(), []
    for k in range(60):
        pose = np.array([0.06 * k, 0.0, 0.0])
        guide.reference(pose, np.array([20.0, 0.0, 0.0]), np.empty((0, 5)), view=view)
        search = guide.state.search
        if search is not None:
            begun.append(search)
            taken_over = k + 1
    # one is under way until the robot has come there
    assert len({id(search) for search in begun}) == 1
    assert begun[0].lead == pytest.approx(0.1 * len(begun))
    np.testing.assert_allclose(begun[0].request.start, (0.06 * taken_over, 0.0, 0.0), atol=1e-6)
