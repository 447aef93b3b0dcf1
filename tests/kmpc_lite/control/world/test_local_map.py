"""The local map: what scans mark, clear, and leave unknown."""

import numpy as np
import pytest
from seen_maps import hit_boxes

import kmpc_lite as kl
from kmpc_lite.control.kernels import library
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.local_map import UNKNOWN, LocalMap
from kmpc_lite.control.world.sight import Sight, View
from kmpc_lite.scale import Scale
from kmpc_lite.types import Array

BEAMS = 360
UNBOUNDED = {"x_min": 3 * [-np.inf], "x_max": 3 * [np.inf]}


def sight(**options: float) -> Sight:
    return Sight(kl.NavigationProblem(**UNBOUNDED), Scale(), SightOptions(**options), reach=1.5)  # type: ignore[arg-type]


def scan(ranges: Array, **options: float) -> kl.LaserScan:
    return kl.LaserScan(ranges, -np.pi, 2 * np.pi / len(ranges), 4.0, **options)  # type: ignore[arg-type]


def state_at(seen: LocalMap, x: float, y: float) -> int:
    cells, inside = seen.cells_of(np.array([[x, y]]))
    assert inside.all()
    return max(int(seen.state.ravel()[cells[0]]), UNKNOWN)


def look(s: Sight, seen: LocalMap | None, ranges: Array, pose: Array | None = None) -> LocalMap:
    exact = scan(ranges, noise=0.0)
    found = s.look(seen, [exact], np.zeros(3) if pose is None else pose, 0.0)
    assert found is not None
    return found


ROUND = np.full(BEAMS, 1.0)


def test_what_rays_pass_is_free_what_they_hit_is_occupied_and_the_rest_unknown() -> None:
    seen = look(sight(), None, ROUND)
    assert state_at(seen, 0.5, 0.3) == 0
    assert state_at(seen, 1.001, 0.0) > 0
    assert state_at(seen, 1.3, 0.0) == UNKNOWN


@pytest.mark.parametrize("speed", [0.0, 0.3, -0.3])
def test_beams_that_report_nothing_hide_nothing_where_they_do_not_point(speed: float) -> None:
    s, seen, ranges = sight(), None, np.full(BEAMS, 3.0)
    ranges[20:25] = np.nan  # behind, to the right
    increment = 2.0 * np.pi / BEAMS
    for k in range(30):
        pose = np.array([0.1 * speed * k, 0.025, 0.0])
        told = kl.LaserScan(ranges, 0.5 * increment - np.pi, increment, 8.0, time_increment=1e-4)
        seen = s.look(seen, [told], pose, 0.0)
    assert seen is not None
    ahead = np.stack([pose[0] + np.arange(0.2, 1.5, 0.02), np.full(65, 0.025)], axis=1)
    cells, inside = seen.cells_of(ahead)
    assert inside.all() and (seen.state.ravel()[cells] > UNKNOWN).all()


def test_what_was_seen_is_remembered_out_of_sight_then_forgotten() -> None:
    s = sight(memory=2.0)
    seen = look(s, None, ROUND)
    nothing = np.full(BEAMS, np.nan)
    for _ in range(15):
        seen = look(s, seen, nothing)
    assert state_at(seen, 1.001, 0.0) > 0 and state_at(seen, 0.5, 0.3) == 0
    for _ in range(10):
        seen = look(s, seen, nothing)
    assert state_at(seen, 1.001, 0.0) == UNKNOWN == state_at(seen, 0.5, 0.3)
    # the robot itself still stands where it stands
    assert state_at(seen, 0.0, 0.0) == 0


@pytest.mark.parametrize("far", [1.0, 3.5])
def test_rays_that_pass_through_clear_what_has_gone(far: float) -> None:
    s = sight(passes=3)
    seen = look(s, None, np.full(BEAMS, far))
    for k in range(3):
        assert state_at(seen, far + 0.001, 0.0) == 3 - k
        seen = look(s, seen, np.full(BEAMS, np.inf))
    assert state_at(seen, far + 0.001, 0.0) == 0


@pytest.mark.parametrize(("most_cells", "remembers"), [(100, False), (400, True)])
def test_the_map_follows_the_robot_in_bounded_memory(most_cells: int, remembers: bool) -> None:
    s, pose = sight(most_cells=most_cells), np.zeros(3)
    shape = (seen := look(s, None, ROUND)).state.shape
    for _ in range(95):  # more than twice as far as the scanner reaches
        pose[0] += 0.1
        seen = look(s, seen, ROUND, pose)
    assert seen.state.shape == shape and max(shape) <= most_cells + 2
    assert len(seen.trail) <= 64
    assert max(state_at(seen, 10.48, 0.0), state_at(seen, 10.52, 0.0)) > 0
    assert state_at(seen, 9.0, 0.0) == 0
    assert seen.cells_of(np.array([(-1.0, 0.0)]))[1].any() == remembers


def test_scans_of_the_past_are_seen_from_where_the_robot_was_then() -> None:
    s, pose, seen = sight(), np.zeros(3), None
    for _ in range(4):
        late = kl.LaserScan([1.0], 0.0, 1.0, 4.0, noise=0.0, age=0.2)
        seen = s.look(seen, [late], pose, 0.0)
        pose = pose + (0.1, 0.0, 0.0)
    assert seen is not None
    x = np.sort(hit_boxes(seen)[0][:, 0])
    np.testing.assert_allclose(x, [1.0, 1.1], atol=1e-6)


@pytest.mark.parametrize(("most_cells", "finer"), [(400, 3), (40, 1)])
def test_a_path_search_sees_all_that_was_hit_and_little_more(most_cells: int, finer: int) -> None:
    s, pose = sight(most_cells=most_cells), np.array([0.013, 0.031, 0.3])
    seen = look(s, None, ROUND, pose)
    solids, coarse = View(s, seen, pose).solids(None)
    assert solids and coarse == pytest.approx(np.sqrt(2.0) * seen.cell / finer)
    points, (low, high) = np.random.default_rng(1).uniform(-1.5, 1.5, (2000, 2)), hit_boxes(seen)
    exact = library.box_distances(low, high, points)
    lost = (exact - solids.whole.least(points))[exact > coarse]
    assert -1e-6 <= lost.min() and 0.5 * coarse < lost.max() <= coarse + 1e-6
    s.look(seen, [scan(ROUND)], pose, 1e3)  # poses that may be anywhere make no larger map
    assert (solids := View(s, seen, pose).solids(None)[0]) and solids.extent < 20.0
