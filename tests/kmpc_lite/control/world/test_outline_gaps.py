"""The robot's outline against solids: dense samples of both, directions, and what circles keep."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.world.outline_gaps import KEPT, outline_gaps
from kmpc_lite.control.world.outlines import Outlines
from kmpc_lite.control.world.solids import Solids

CART = kl.Footprint.rectangle(0.5, 0.25, ahead=-0.15)
SOLIDS = [
    kl.Polygon([(0.0, 0.0), (1.0, 0.1), (0.8, 0.7)]),
    kl.Polygon([(-1.2, -0.9), (-0.6, -1.0), (-0.5, -0.3), (-1.0, -0.2)]),
    kl.Wall(-1.0, 0.8, 0.2, 1.1, 0.06),
    kl.Wall(0.6, -0.7, 0.9, -0.4, 0.0),
]


def poses(count: int, seed: int = 0) -> np.ndarray:
    """Poses (count, 3) among the solids."""
    random = np.random.default_rng(seed)
    return random.uniform(-1.0, 1.0, (count, 3)) * (1.6, 1.6, np.pi)


def outlines() -> Outlines:
    """What the solids are made of."""
    return Solids(SOLIDS).outlines


def boundary(corners: np.ndarray, count: int = 400) -> np.ndarray:
    """Points (K count, 2) on the edges between corners (K, 2)."""
    shares = np.linspace(0.0, 1.0, count, endpoint=False)[:, None, None]
    return (corners + shares * (np.roll(corners, -1, axis=0) - corners)).reshape(-1, 2)


def placed(pose: np.ndarray) -> np.ndarray:
    """Corners (4, 2) of the cart at a pose (3,)."""
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    return CART.outline @ [[cos, sin], [-sin, cos]] + pose[:2]


def test_distances_are_those_of_dense_samples():
    solids, here = outlines(), poses(300)
    found, _ = outline_gaps(solids, CART.outline, here)
    for pose, gaps in zip(here, found, strict=True):
        nearest = solids.distances(boundary(placed(pose)))[0].min(axis=0)
        apart = nearest > 0.01
        np.testing.assert_allclose(gaps[apart], nearest[apart], atol=2e-3)
        entered = (solids.distances(placed(pose))[0] < 0.0).any(axis=0)
        assert (gaps[entered] < 0.0).all()


def test_a_step_in_the_direction_away_gains_as_much():
    solids, here = outlines(), poses(300, seed=1)
    found, away = outline_gaps(solids, CART.outline, here)
    np.testing.assert_allclose(np.hypot(*away.transpose(2, 0, 1)), 1.0, atol=1e-6)
    step = 1e-4
    for solid in range(len(solids)):
        moved = here.copy()
        moved[:, :2] += step * away[:, solid]
        gained = outline_gaps(solids, CART.outline, moved)[0][:, solid] - found[:, solid]
        near = (found[:, solid] > 0.0) & (found[:, solid] < 1.0)
        np.testing.assert_allclose(gained[near], step, rtol=2e-2)


def test_it_is_the_same_wherever_the_map_lies():
    random, here = np.random.default_rng(2), poses(50, seed=3)
    shift, turn = random.uniform(-5.0, 5.0, 2), 1.1
    cos, sin = np.cos(turn), np.sin(turn)
    turned = np.array([[cos, sin], [-sin, cos]])
    elsewhere = Solids(
        [kl.Polygon(np.asarray(s.vertices) @ turned + shift) for s in SOLIDS[:2]]
    ).outlines
    there = here.copy()
    there[:, :2] = here[:, :2] @ turned + shift
    there[:, 2] += turn
    first, away = outline_gaps(Solids(SOLIDS[:2]).outlines, CART.outline, here)
    second, away_there = outline_gaps(elsewhere, CART.outline, there)
    np.testing.assert_allclose(second, first, atol=1e-12)
    np.testing.assert_allclose(away_there, away @ turned, atol=1e-9)


def test_circles_beside_the_outline_keep_what_it_keeps_and_a_tenth_of_their_radius():
    whole, here = Solids(SOLIDS).whole, poses(400, seed=4)
    points = places_of(CART, here).reshape(-1, 2)
    count = len(CART.circles)
    circles = whole.least(points).reshape(-1, count).min(axis=1) - CART.circle_radius
    sharp = whole.least(points, body=(CART, here)).reshape(-1, count).min(axis=1)
    sharp -= CART.circle_radius
    exact = outline_gaps(outlines(), CART.outline, here)[0].min(axis=1)
    assert (sharp >= circles - 1e-12).all()
    apart = exact > 0.0
    assert (sharp[apart] <= np.maximum(exact, circles)[apart] + 1e-9).all()
    # between what the circles touch and what is far away
    near = apart & (circles < 0.2 * CART.circle_radius) & (circles > -0.1 * CART.circle_radius)
    expected = np.maximum(exact - KEPT * CART.circle_radius, circles)
    assert near.sum() > 10
    assert sharp[near] == pytest.approx(expected[near], abs=1e-9)
