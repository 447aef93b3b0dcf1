"""Paths of any wheels: exact ends, curvature within the wheels', and the outline kept clear."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from path_requests import found, request

import kmpc_lite as kl
from kmpc_lab.sim.maps import random_map
from kmpc_lite.control.path.capabilities import follows_poses
from kmpc_lite.control.path.field_planner import NO_ROOM, NO_WAY, FieldPlanner
from kmpc_lite.control.path.motions import TURNS, chained, curves, seen_from
from kmpc_lite.control.path.planner import Path, Route
from kmpc_lite.control.wheels import Car, Differential, Omni
from kmpc_lite.control.world.solids import Solids

FAST = {"u_min": (-0.6, -2.0), "u_max": (0.6, 2.0)}
PROBLEM = kl.NavigationProblem(**FAST)
CART = kl.Footprint.rectangle(0.5, 0.25, ahead=-0.15)
FOUR = [(0.5, 0.3, 0.3), (-0.3, 0.6, 0.25), (-0.4, -0.6, 0.3), (0.7, -0.7, 0.25)]
CAR = Car(0.4)
ALL = [CAR, Car(0.4, reverse=False), Omni(), Differential()]


def search(wheels, asked, problem=PROBLEM, quanta=1):
    return found(FieldPlanner(problem, wheels), asked, quanta)


def curvature(path):
    """Largest curvature between neighbours of a path that drives."""
    steps = np.diff(path.poses, axis=0)
    steps = steps[np.abs(steps[:, 2]) > 1e-9]
    # of an arc by its chord
    curved = 2.0 * np.sin(0.5 * np.abs(steps[:, 2])) / np.hypot(steps[:, 0], steps[:, 1])
    return float(curved.max(initial=0.0))


def between(path, count=8):
    """Poses on a path, closer than those that it is made of."""
    grid = np.arange(len(path.poses))
    fine = np.linspace(0, grid[-1], count * len(grid))
    return np.stack([np.interp(fine, grid, column) for column in path.poses.T], axis=1)


@pytest.mark.parametrize("footprint", [CART, None])
def test_out_of_a_room_whose_walls_are_thinner_than_cells_and_longer_than_usual(footprint):
    room = [(-10, 0, 9, 0), (-10, 0, -10, 20), (10, 0, 10, 20), (-10, 20, 10, 20)]
    walls = [kl.Wall(*ends, 0.05) for ends in room]
    asked = request((0, 0.8, 0), (0, -0.8, 0), (), walls, footprint, area=60)
    assert search(CAR, asked, replace(PROBLEM, footprint=footprint), 50).times[-1] < 40.0


@pytest.mark.parametrize("wheels", ALL, ids=str)
@pytest.mark.parametrize("goal", [(1.5, 1.5, 0.0), (1.5, 1.5, 3.0), (-1.5, 1.4, 1.0)])
def test_among_circles_paths_are_exact_and_clear(wheels, goal):
    asked = request((-1.5, -1.5, 0.0), goal, FOUR)
    path = search(wheels, asked)
    assert isinstance(path, Path)
    np.testing.assert_allclose(path.poses[0], asked.start)
    missed = path.poses[-1] - asked.goal
    assert np.abs(missed[:2]).max() < 1e-9 and abs(np.sin(0.5 * missed[2])) < 1e-9
    assert np.diff(path.times).min() > 0.0
    poses = between(path)
    away = np.hypot(*(poses[:, None, :2] - np.array(FOUR)[:, :2]).transpose(2, 0, 1))
    assert (away - np.array(FOUR)[:, 2]).min() > 0.15 - 0.005
    if isinstance(wheels, Car):
        assert curvature(path) <= wheels.curvature
        assert (path.gears != 0).all()
        assert wheels.reverse or (path.gears > 0).all()


def test_a_car_s_path_is_as_wide_as_it_curves_and_wider_if_it_steers_late():
    there = request((0, 0, 0), (0.0, 1.0, np.pi))

    def tightest_turn(**known):
        path = search(CAR, replace(there, **known))
        ways = np.hypot(*np.diff(path.poses[:, :2], axis=0).T)
        return 1.0 / float((np.abs(np.diff(path.poses[:, 2])) / ways).max())

    usual = tightest_turn()
    assert usual == pytest.approx(1.05 * 0.4, rel=0.01)
    assert tightest_turn(curving=0.8) == pytest.approx(usual / 0.8, rel=0.01)
    # at 0.6 m/s, it drives a third of its turning radius meanwhile
    late = 0.4 / 0.6 / 3.0
    assert tightest_turn(steering_lag=late) == pytest.approx(usual * (1.0 + 0.2 / 3.0), rel=0.01)


def slot(gap):
    """Two boxes along a kerb, and the pose between them."""
    length = 0.5 * gap
    boxes = [
        kl.Polygon([(-1.0, -0.3), (0.0, -0.3), (0.0, 0.0), (-1.0, 0.0)]),
        kl.Polygon([(length, -0.3), (length + 1, -0.3), (length + 1, 0.0), (length, 0.0)]),
        kl.Wall(-1.0, -0.36, length + 1, -0.36, 0.02),
    ]
    return boxes, (0.5 * length - 0.15, -0.16, 0.0)


@pytest.mark.parametrize(
    "gap, start", [(1.4, (1.2, 0.3, 0.0)), (1.7, (1.2, 0.3, 0.0)), (1.4, (0.25, -0.17, 0.0))]
)
def test_a_car_parks_by_changes_of_gear_with_the_room_that_its_ends_have(gap, start):
    boxes, goal = slot(gap)
    problem = replace(PROBLEM, footprint=CART)
    path = search(CAR, request(start, goal, solids=boxes, footprint=CART), problem)
    assert isinstance(path, Path)
    assert curvature(path) <= CAR.curvature
    assert 1 <= (np.diff(path.gears[path.gears != 0]) != 0).sum() <= 4
    room = np.array([Solids(boxes).whole.least(CART.places(p)).min() for p in between(path)])
    assert room.min() > min(*room[[0, -1]], CART.circle_radius) - 0.005


def test_what_cannot_be_reached_is_reported_with_the_reason():
    walls = [kl.Wall(-2, 0.2, 2, 0.2, 0.02), kl.Wall(-2, -0.2, 2, -0.2, 0.02)]
    asked = request((-1, 0, 0), (1, 0, np.pi), solids=walls)
    assert search(Car(0.4, reverse=False), asked) == NO_ROOM
    assert isinstance(search(Differential(), asked), Path)
    closed = [kl.Wall(0, -2.5, 0, 2.5, 0.02)]
    for wheels in (CAR, Omni(), Differential()):
        assert search(wheels, request((-1, 0, 0), (1, 0, 0), solids=closed)) == NO_WAY


@pytest.mark.parametrize("seed", [8100003, 8200009])
def test_a_gap_that_is_hardly_too_narrow_holds_no_search_up(seed: int) -> None:
    drawn, planner = random_map("dense", seed), FieldPlanner(PROBLEM, Omni())
    planner.begin(request(drawn.start, drawn.goal, [circle[:3] for circle in drawn.circles]))
    assert planner.advance(3000) < 3000 and isinstance(planner.path(), Path)


def test_slices_of_any_length_give_the_same_path():
    asked = request((-1.5, -1.5, 0.0), (1.5, 1.5, 2.0), FOUR)
    one, other = (search(CAR, asked, quanta=quanta) for quanta in (1, 1000))
    np.testing.assert_array_equal(one.poses, other.poses)


def test_a_path_of_kilometres_is_compared_with_the_one_driven_in_little_memory():
    asked = request((0, 0, 0), (4000, 0, 0), area=np.inf)
    points = search(Omni(), asked).poses[:, :2]
    for aside in (0.2, 0.4):
        driven = Route(points + (0.0, aside), reverse=False, clearance=0.0, lost=0.0)
        assert search(Omni(), replace(asked, driven=driven)).switched == (aside > 2 * 0.15)


@pytest.mark.parametrize("least", [0.0, -0.1])
def test_a_robot_that_hardly_turns_right_goes_round_by_the_left(least: float) -> None:
    problem = kl.NavigationProblem(u_min=(-0.6, least), u_max=(0.6, 2.0))
    assert follows_poses(problem) and not follows_poses(PROBLEM)
    path = search(Differential(), request((-1.0, 0.0, 0.0), (-1.0, -1.0, -1.5)), problem)
    turns = np.diff(path.poses[:, 2])
    assert np.allclose(path.poses[-1, :2], (-1.0, -1.0))
    assert np.isclose(np.cos(path.poses[-1, 2] + 1.5), 1.0)
    # on the way to the right it would turn by -1.5: to the left that is nearly a whole turn
    assert turns[turns > 0.0].sum() > 4.0 and turns[turns < 0.0].sum() > -0.2
    rates = turns / np.diff(path.times)
    assert rates.max() <= 0.9 * 2.0 + 1e-9 and rates.min() >= 0.9 * least - 1e-9


RNG = np.random.default_rng(4)
ENDS = np.column_stack([RNG.uniform(-6, 6, (300, 2)), RNG.uniform(-np.pi, np.pi, 300)])


def lengths(ends):
    return np.abs(curves(np.asarray(ends, dtype=float))).sum(axis=-1).min(axis=-1)


def test_every_word_leads_to_its_end():
    found = curves(ENDS)
    reached = np.isfinite(found).all(axis=-1)
    assert reached.any(axis=0).all() and reached.any(axis=1).all()
    steps = np.where(reached[..., None], found, 0.0)
    twists = np.stack([np.sign(steps), np.zeros_like(steps), np.sign(steps) * TURNS], axis=-1)
    ends = chained(np.zeros(3), twists, np.abs(steps))[..., -1, :]
    missed = ends - ENDS[:, None]
    missed[..., 2] = np.angle(np.exp(1j * missed[..., 2]))
    assert np.abs(missed[reached]).max() < 1e-9


def test_the_way_back_is_as_long_and_so_is_the_mirrored_one():
    back = np.array([seen_from(end, np.zeros(3)) for end in ENDS])
    np.testing.assert_allclose(lengths(back), lengths(ENDS), atol=1e-9)
    np.testing.assert_allclose(lengths(ENDS * (1, -1, -1)), lengths(ENDS), atol=1e-9)


def test_known_lengths():
    # turning round in place takes three arcs of a sixth of a turn
    ends = [(3.0, 0.0, 0.0), (-3.0, 0.0, 0.0), (1.0, 1.0, np.pi / 2), (0.0, 0.0, np.pi)]
    assert lengths(ends) == pytest.approx([3.0, 3.0, np.pi / 2, np.pi])
