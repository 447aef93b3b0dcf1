"""The local map: what scans mark, clear, and leave unknown."""

import time

import numpy as np
import pytest
from reference.scans import see_through
from seen_maps import hit_boxes

import kmpc_lite as kl
from kmpc_lite.control.options import SightOptions
from kmpc_lite.control.world.sight.local_map import UNKNOWN, LocalMap
from kmpc_lite.control.world.sight.rays import Rays
from kmpc_lite.control.world.sight.sight import Sight
from kmpc_lite.control.world.sight.view import View
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


def test_a_place_was_free_until_something_was_seen_before_it() -> None:
    s = sight()
    seen = look(s, None, ROUND)
    for reach in (0.9, 0.8, 0.7):
        seen = look(s, seen, np.full(BEAMS, reach))
    cells, _ = seen.cells_of(np.array([[0.6, 0.0], [0.801, 0.0], [0.901, 0.0], [1.001, 0.0]]))
    # what was hit when the map began may have stood there for ever
    assert seen.was_free(cells, 0.25).tolist() == [True, True, True, False]
    assert seen.was_free(cells, 0.15).tolist() == [True, True, False, False]


@pytest.mark.parametrize("tip", [0, 1])
def test_all_hits_in_one_cell_count(tip: int) -> None:
    """A corner between them may stand farther out than any one of them."""
    s, ranges = sight(), np.full(BEAMS, np.inf)
    beams = BEAMS // 2 + np.array([1, 2])
    ranges[beams] = 1.04
    ranges[beams[tip]] = 1.01
    seen = look(s, None, ranges)
    cells = np.flatnonzero(seen.state > 0)
    assert len(cells) == 1
    told = scan(ranges)
    hits = told.ends[told.hits]
    low, high = hit_boxes(seen)
    np.testing.assert_allclose(low[0], hits.min(axis=0), atol=1e-6)
    np.testing.assert_allclose(high[0], hits.max(axis=0), atol=1e-6)


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


def test_the_map_follows_the_robot_in_bounded_memory() -> None:
    s, pose = sight(most_cells=100), np.zeros(3)
    seen = look(s, None, ROUND)
    shape = seen.state.shape
    for _ in range(60):
        pose[0] += 0.1
        seen = look(s, seen, ROUND, pose)
    assert seen.state.shape == shape and max(shape) <= 102
    assert len(seen.trail) <= 64
    assert max(state_at(seen, 6.98, 0.0), state_at(seen, 7.02, 0.0)) > 0
    assert state_at(seen, 5.5, 0.0) == 0
    assert not seen.cells_of(np.zeros((1, 2)))[1].any()


def test_scans_of_the_past_are_seen_from_where_the_robot_was_then() -> None:
    s, pose, seen = sight(), np.zeros(3), None
    for _ in range(4):
        late = kl.LaserScan([1.0], 0.0, 1.0, 4.0, noise=0.0, age=0.2)
        seen = s.look(seen, [late], pose, 0.0)
        pose = pose + (0.1, 0.0, 0.0)
    assert seen is not None
    x = np.sort(hit_boxes(seen)[0][:, 0])
    np.testing.assert_allclose(x, [1.0, 1.1], atol=1e-6)


def test_what_stands_beside_a_path_of_any_length_is_found_in_time() -> None:
    s = sight()
    seen = look(s, None, np.full(360, 1.0))
    hit = np.array([[0.95, 0.0]])
    # ten thousand kilometres in steps of half a metre, past the hit
    path = np.stack([np.zeros(20_000), 500.0 * np.arange(20_000)], axis=1)
    begun = time.process_time()
    assert not View(s, seen, np.zeros(3)).blocks(path + [3.0, 20.0], 0.2)
    assert View(s, seen, np.zeros(3)).blocks(np.concatenate([path + [3.0, 20.0], hit]), 0.2)
    assert time.process_time() - begun < 0.4


@pytest.mark.parametrize("turn", [0.0, 2.5])
@pytest.mark.parametrize("old", [False, True])
def test_no_cell_beyond_the_area_of_a_scan_is_passed_through(turn: float, old: bool) -> None:
    random, cell = np.random.default_rng(4), 0.05
    for _ in range(20):
        ranges = random.uniform(0.2, 4.0, 40)
        one = kl.LaserScan(ranges, -0.5, 0.02, 4.0, mount=(0.2, 0.1, turn))
        poses = np.array([1.0, 2.0, random.uniform(-3.0, 3.0)])
        if old:
            poses = poses + np.linspace(-0.1, 0.0, len(ranges))[:, None] * (1.0, 1.0, 0.5)
        rays = Rays(one, poses, cell)
        state, none = np.full((200, 200), UNKNOWN, dtype=np.int8), np.zeros((200, 200, 5))
        cells = state, none[..., 0].astype(np.float32), none[..., 1:].astype(np.float32)
        window, place = (0, 200, 0, 200), (cell, -80, -60)
        see_through(*cells, window, place, rays.origin, rays.turn, rays.squares, 1.0, False)
        row, column = np.nonzero(state == 0)
        passed = cell * (np.stack([column, row], axis=1) + np.array([-79.5, -59.5]))
        assert len(passed)
        assert ((passed > rays.low) & (passed < rays.high)).all()
