"""What the options of sight mean for the paper's robot, looked at on both sides of each number."""

from __future__ import annotations

import numpy as np
import pytest
from guided import GuideInUse
from seen_maps import hit_boxes

import kmpc_lite as kl
from kmpc_lite.control.options import GuidanceOptions, SightOptions
from kmpc_lite.control.path.tangent_planner import TangentPlanner
from kmpc_lite.control.world.sight.local_map import UNKNOWN, LocalMap
from kmpc_lite.control.world.sight.sight import Sight
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


def test_cells_have_a_third_of_a_radius_and_twice_the_noise_of_the_ranges() -> None:
    assert looked().cell == pytest.approx(0.05)
    assert looked(noise=0.0249).cell == pytest.approx(0.05)
    assert looked(noise=0.0251).cell == pytest.approx(0.1)


def test_the_map_reaches_twice_as_far_as_the_scanner_and_has_400_cells_a_side() -> None:
    near, far = looked(LARGE, 3.5), looked(LARGE, 50.0)
    assert near.state.shape[1] * near.cell == pytest.approx(2.0 * 2.0 * 3.5, rel=0.02)
    assert far.state.shape[1] == pytest.approx(400, abs=2)


def test_a_map_of_the_whole_area_has_400_cells_a_side_at_the_most() -> None:
    # three metres around the area are kept, and a cell
    for side, fixed in ((13.8, True), (14.0, False)):
        area = {"x_min": (0.0, 0.0, -np.inf), "x_max": (side, side, np.inf)}
        assert looked(kl.NavigationProblem(**area)).is_fixed is fixed  # type: ignore[arg-type]


def test_what_is_out_of_sight_is_known_for_two_minutes() -> None:
    eyes, here = sight(), looked()
    cells = np.flatnonzero(here.state.ravel() > 0)
    elsewhere = np.array([1.5, 0.0, 0.0])
    states = {}
    for seconds in (110.0, 129.0):
        here.clock = seconds
        eyes.look(here, [], elsewhere, 0.0)
        states[seconds] = here.state.ravel()[cells]
    assert (states[110.0] > 0).all() and (states[129.0] == UNKNOWN).all()


def test_a_cell_that_was_hit_is_free_after_three_scans_have_passed() -> None:
    eyes, here = sight(), looked()
    cells = np.flatnonzero(here.state.ravel() > 0)
    left = []
    for _ in range(4):
        eyes.look(here, [scan(4.0)], HERE, 0.0)
        left.append(int(np.count_nonzero(here.state.ravel()[cells])))
    assert left[0] and left[1] and not left[2]


def test_a_surface_is_nearer_than_seen_by_two_standard_deviations() -> None:
    """Of a range that counts with its neighbours, and of the pose."""
    here = sight().look(None, [scan(1.0, noise=0.003)], HERE, 0.001)
    assert here is not None
    cells, _ = here.cells_of(np.array([[1.01, 0.01], [0.99, 0.01]]))
    chosen = np.isin(np.flatnonzero(here.state > 0), cells)
    nearest = hit_boxes(here)[0][chosen, 0].min()
    errors = 2.0 * np.hypot(0.003 / np.sqrt(2.0), 0.001)
    assert nearest == pytest.approx(np.cos(2.0 * STEP) - errors, abs=1e-6)


def test_what_is_within_a_cell_of_a_line_counts_as_behind_it() -> None:
    (boxes,) = sight().seen(looked(), HERE).hits
    assert boxes._behind == pytest.approx(0.05)


def test_cells_are_noted_as_free_up_to_three_metres() -> None:
    here = sight(LARGE).look(None, [scan(9.0, 10.0)], HERE, 0.0)
    assert here is not None
    rows, columns = np.nonzero(here.state == 0)
    x = (columns + here.column + 0.5) * here.cell
    y = (rows + here.row + 0.5) * here.cell
    assert max(np.abs(x).max(), np.abs(y).max()) == pytest.approx(20 * 0.15, abs=0.06)


def test_sixty_four_poses_of_the_past_are_kept() -> None:
    eyes, here = sight(), looked()
    for k in range(80):
        eyes.look(here, [], np.array([0.001 * k, 0.0, 0.0]), 0.0)
    assert len(here.trail) == 64


def test_nobody_steps_out_of_what_is_not_seen_now() -> None:
    usual, wary = (sight(emerging_speed=speed) for speed in (0.0, 0.2))
    ahead = kl.LaserScan(np.full(90, 2.0), -np.pi / 4, STEP, 5.0)
    here: LocalMap | None = looked()
    for _ in range(3):
        here = usual.look(here, [ahead], HERE, 0.0)
    assert here is not None

    def dark(eyes: Sight) -> float:
        boxes = eyes.seen(here, HERE).unknown
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


def test_what_is_hit_beside_a_robot_that_begins_is_there() -> None:
    here = sight(free_at_start=3.0).look(None, [scan(0.4)], HERE, 0.0)
    assert here is not None and here.state.max() > 0


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


def drive(view: OneView, steps: int) -> list[float]:
    """A robot drives along its path; how old that is in each step [s]."""
    guide, ages = GuideInUse(LARGE), []
    for k in range(steps):
        pose = np.array([0.03 * k, 0.0, 0.0])
        guide.reference(pose, np.array([20.0, 0.0, 0.0]), np.empty((0, 5)), view=view)
        ages.append(guide.state.age)
    return ages


def test_a_path_is_looked_for_anew_after_three_seconds() -> None:
    assert max(drive(OneView(), 60)) == pytest.approx(3.0, abs=0.15)


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


def test_five_times_a_second_is_looked_for_what_stands_on_the_path() -> None:
    view = OneView()
    drive(view, 30)
    assert view.looks == pytest.approx(5 * 2.7, abs=1)


def test_a_lattice_of_what_was_seen_has_twelve_thousand_nodes() -> None:
    cells = np.zeros((200, 200), dtype=bool)
    cells[::10, ::10] = True
    planner = TangentPlanner(LARGE, GuidanceOptions())
    guide = GuideInUse(LARGE, planner=planner)
    view = OneView(Solids([kl.OccupancyGrid(cells, 0.05, (1.0, 1.0))]))
    guide.reference(HERE, np.array([10.0, 0.0, 0.0]), np.empty((0, 5)), view=view)
    assert planner._lattice is not None
    assert len(planner._lattice._places) == pytest.approx(12_000, rel=0.04)


def test_nodes_of_a_lattice_of_what_was_seen_lie_seven_and_a_half_centimetres_apart() -> None:
    cells = np.zeros((20, 20), dtype=bool)
    cells[::2, ::2] = True
    planner = TangentPlanner(LARGE, GuidanceOptions())
    guide = GuideInUse(LARGE, planner=planner)
    view = OneView(Solids([kl.OccupancyGrid(cells, 0.05, (1.0, 1.0))]))
    guide.reference(HERE, np.array([0.0, 1.0, 0.0]), np.empty((0, 5)), view=view)
    assert planner._lattice is not None
    assert planner._lattice.step == pytest.approx(0.075)
