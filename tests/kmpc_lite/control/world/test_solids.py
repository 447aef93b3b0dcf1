"""Polygons, walls and grids: what is refused, distances against dense samples, normals, and what a
step sees of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lite as kl
from kmpc_lite.control import Footprint
from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels.records import COLUMNS
from kmpc_lite.control.world.occupancy import BEHIND, GRID_COLUMNS, Boxes
from kmpc_lite.control.world.outlines import MANY, Outlines, outline_gaps
from kmpc_lite.control.world.scene import Solid, Surroundings
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.scenario.touch import footprint_gaps

"""How far the robot drives before what is near is looked up again [m]."""


def polygon(random: np.random.Generator, corners: int = 6) -> kl.Polygon:
    """Convex, with corners on an ellipse."""
    angles = np.linspace(0.0, 2 * np.pi, corners, endpoint=False) + random.uniform(
        0.0, 4.0 / corners, corners
    )
    axes, centre, turn = (
        random.uniform(0.1, 0.6, 2),
        random.uniform(-1.5, 1.5, 2),
        random.uniform(-3.0, 3.0),
    )
    local = np.column_stack([axes[0] * np.cos(angles), axes[1] * np.sin(angles)])
    return kl.Polygon(
        centre + local @ [[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]
    )


def grid(random: np.random.Generator) -> kl.OccupancyGrid:
    """Scattered cells, so that rectangles of all kinds come out."""
    return kl.OccupancyGrid(
        random.random((12, 15)) < 0.15, 0.2, (-1.5, -1.2, random.uniform(-3.0, 3.0))
    )


def some(random: np.random.Generator) -> list[Solid]:
    """Polygons, walls and a grid."""
    walls = [
        kl.Wall(*random.uniform(-2.0, 2.0, 4), thickness=random.uniform(0.0, 0.3)) for _ in range(3)
    ]
    return [
        polygon(random, 3),
        polygon(random),
        *walls,
        kl.Wall(0.3, 0.4, 0.3, 0.4, 0.2),
        grid(random),
    ]


def samples(solid: Solid) -> np.ndarray[Any, Any]:
    """Points (n, 2) on the outline, no farther than 2 mm from each other."""
    share = np.linspace(0.0, 1.0, 1001)[:, None]
    if isinstance(solid, kl.Wall):
        line = (1 - share) * (solid.x1, solid.y1) + share * (solid.x2, solid.y2)
        around = 0.5 * solid.thickness * np.column_stack([np.cos(6.3 * share), np.sin(6.3 * share)])
        return (
            np.concatenate([line + around[i] for i in range(0, 1001, 8)])
            if solid.thickness
            else line
        )
    if isinstance(solid, kl.Polygon):
        corners = [np.array(solid.vertices)]
    else:
        cells = np.argwhere(solid.occupied)[:, None, ::-1] + np.array(
            [[0, 0], [1, 0], [1, 1], [0, 1]]
        )
        corners = list(solid.to_map(solid.resolution * cells))
    return np.concatenate(
        [
            (1 - share) * a + share * b
            for c in corners
            for a, b in zip(c, np.roll(c, -1, axis=0), strict=True)
        ]
    )


@pytest.mark.parametrize(
    ("vertices", "words"),
    [
        ([(0, 0), (1, 0)], "at least 3 corners"),
        ([(0, 0), (2, 0), (0.5, 0.5), (0, 2)], "convex"),
        ([(np.cos(4 * np.pi * k / 5), np.sin(4 * np.pi * k / 5)) for k in range(5)], "convex"),
        ([(0, 0), (1, 0), (1, 0), (0, 1)], "twice"),
        ("abc", "real numbers"),
    ],
)
def test_outlines_that_are_none_are_refused(vertices: Any, words: str) -> None:
    with pytest.raises(kl.ProblemError, match=words) as refused:
        kl.Polygon(vertices)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("values", [(0, 0, 1, np.inf), (0, 0, 1, 1, -0.1), (0, 0, 1, "x")])
def test_walls_that_are_none_are_refused(values: Any) -> None:
    with pytest.raises(kl.ProblemError, match="wall"):
        kl.Wall(*values)


@settings(max_examples=8)
@given(seed=st.integers(0, 10_000))
def test_distances_are_those_of_dense_samples(seed: int) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-2.5, 2.5, (12, 2))
    for solid in some(random):
        whole = Solids([solid]).whole
        distance, edge = whole.least(points), samples(solid)
        brute = np.hypot(*(points[:, None] - edge).transpose(2, 0, 1)).min(axis=1)
        outside = distance > 0.0
        np.testing.assert_allclose(distance[outside], brute[outside], atol=3e-3)
        inside = ~outside
        if isinstance(solid, kl.OccupancyGrid):
            cells = np.floor(solid.to_grid(points) / solid.resolution).astype(int)
            within = ((cells >= 0) & (cells < np.array(solid.occupied.shape)[::-1])).all(axis=1)
            occupied = np.zeros(len(points), dtype=bool)
            occupied[within] = solid.occupied[cells[within, 1], cells[within, 0]]
            np.testing.assert_array_equal(inside, occupied)
        elif isinstance(solid, kl.Polygon):
            np.testing.assert_allclose(-distance[inside], brute[inside], atol=3e-3)


@settings(max_examples=10)
@given(seed=st.integers(0, 10_000))
def test_many_points_among_many_solids_are_measured_as_each_by_itself(seed: int) -> None:
    random = np.random.default_rng(seed)
    walls = [kl.Wall(*a, *(a + random.uniform(-1, 1, 2))) for a in random.uniform(-9, 9, (400, 2))]
    brick = [(0, 0), (0.5, 0), (0.4, 0.3)]
    bricks = [kl.Polygon(a + brick) for a in random.uniform(-9, 9, (40, 2))]
    whole, cart = Solids([*walls, *bricks]).whole, kl.Footprint.rectangle(0.6, 0.3, 0.1)
    points = cart.places(poses := random.uniform(-8.0, 8.0, (60, 3))).reshape(-1, 2)
    assert len(points) * 400 > MANY
    cells, low = kl.OccupancyGrid(np.eye(40) * 100, 0.4), random.uniform(-5, 5, (50, 2))
    for all_ in (whole, whole.with_boxes([Boxes(low, low + 0.4, cells, behind=0.3)])):
        every, away = all_.measure(points)
        at, (distance, normals) = every.argmin(axis=1)[:, None], all_.nearest(points)
        np.testing.assert_allclose(distance, every.min(axis=1), atol=1e-12)
        np.testing.assert_allclose(normals, np.take_along_axis(away, at[..., None], 1)[:, 0])
    distance = whole.least(points)
    np.testing.assert_allclose(distance, whole.nearest(points)[0], atol=1e-12)
    alone = [whole.least(cart.places(p[None])[0], (cart, p[None])) for p in poses]
    np.testing.assert_allclose(outline := whole.least(points, (cart, poses)), np.hstack(alone))
    assert (outline > distance + 1e-3).any()
    np.testing.assert_allclose(whole.least(points[:1].repeat(400, axis=0)), distance[0])


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000))
def test_each_half_plane_holds_its_whole_solid_back(seed: int) -> None:
    """What makes a step safe to linearise.

    Outside of the nearest point's half-plane there is nothing of a convex solid.
    """
    random = np.random.default_rng(seed)
    points = random.uniform(-2.5, 2.5, (10, 2))
    for solid in some(random)[:-1]:
        distance, normals = Solids([solid]).whole.measure(points)
        np.testing.assert_allclose(np.hypot(normals[..., 0], normals[..., 1]), 1.0)
        offsets = (normals[:, 0] * points).sum(axis=1) - distance[:, 0]
        assert (samples(solid) @ normals[:, 0].T - offsets).max() <= 1e-9


@settings(max_examples=20)
@given(seed=st.integers(0, 10_000), angle=st.floats(-3.0, 3.0))
def test_turning_everything_turns_the_normals(seed: int, angle: float) -> None:
    random = np.random.default_rng(seed)
    points = random.uniform(-2.5, 2.5, (10, 2))
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])

    def turned(solid: Solid) -> Solid:
        if isinstance(solid, kl.Polygon):
            return kl.Polygon(np.array(solid.vertices) @ turn)
        if isinstance(solid, kl.Wall):
            return kl.Wall(
                *(np.array([[solid.x1, solid.y1], [solid.x2, solid.y2]]) @ turn).ravel(),
                thickness=solid.thickness,
            )
        x, y, yaw = solid.origin
        return kl.OccupancyGrid(
            solid.occupied, solid.resolution, (*(np.array([x, y]) @ turn), yaw + angle)
        )

    solids = some(random)
    distance, normals = Solids(solids).whole.measure(points)
    distance_turned, normals_turned = Solids([turned(s) for s in solids]).whole.measure(
        points @ turn
    )
    np.testing.assert_allclose(distance_turned, distance, atol=1e-9)
    np.testing.assert_allclose(normals_turned, normals @ turn, atol=1e-6)


@settings(max_examples=30)
@given(seed=st.integers(0, 10_000))
def test_what_a_grid_leaves_out_lies_behind_what_it_names(seed: int) -> None:
    """The nearest rectangle is always named.

    With room for more, all others' nearest points lie behind a half-plane that is named.
    """
    random = np.random.default_rng(seed)
    boxes = Solids([grid(random)]).boxes[0]
    points = random.uniform(-2.0, 2.0, (10, 2))
    every = boxes.distances(points)
    chosen, distance, normals = boxes.choose(points)
    assert chosen.shape == (10, min(GRID_COLUMNS, len(boxes.low)))
    np.testing.assert_allclose(distance[:, 0], every.min(axis=1))
    for point in range(len(points)):
        if len(set(chosen[point])) < GRID_COLUMNS:
            corners = boxes.grid.to_grid(points[point])
            nearest = np.clip(corners, boxes.low, boxes.high)
            in_front = (boxes.grid.to_map(nearest) - points[point]) @ -normals[point].T
            outside = every[point] > 0.0
            assert (in_front >= distance[point] - BEHIND - 1e-12).any(axis=1)[outside].all()


OUTLINE = Footprint.rectangle(0.5, 0.36, ahead=-0.1)
SOLIDS = [
    kl.Polygon([(0.6, -1.0), (1.5, -0.4), (1.2, 0.8)]),
    kl.Polygon([(-1.2, -0.5), (-0.6, -0.5), (-0.6, 0.4), (-1.2, 0.4)]),
    kl.Wall(-1.0, 0.9, 1.0, 1.1, 0.04),
]


def gaps(poses: np.ndarray, count: int = 1) -> tuple[np.ndarray, np.ndarray]:
    return outline_gaps(Outlines.of(SOLIDS), OUTLINE, poses, count)


def test_the_nearest_points_are_the_robots_and_slopes_those_of_their_distances() -> None:
    poses = np.random.default_rng(4).uniform((-1.0, -1.0, -3.0), (1.0, 1.0, 3.0), (400, 3))
    truth = footprint_gaps(OUTLINE, poses, np.empty((400, 0, 3)), SOLIDS)
    poses, truth = poses[truth > 0.01], truth[truth > 0.01]
    found, slopes = gaps(poses, 3)
    np.testing.assert_allclose(found[:, 0].min(axis=1), truth, atol=1e-9)
    assert (np.diff(found, axis=1) >= 0.0).all()
    for axis, step in enumerate(1e-6 * np.eye(3)):
        told = (gaps(poses + step)[0] - gaps(poses - step)[0])[:, 0] / 2e-6
        # but where the nearest point changes
        assert np.isclose(told, slopes[:, 0, :, axis], atol=1e-4).mean() > 0.99


def test_no_clearance_grows_faster_than_the_robot_moves() -> None:
    """A slope of 16,000 between two sides made all but standing unsafe, for good."""
    car, half = Footprint.rectangle(0.618532, 0.257077, -0.2298), 0.21401776268342415
    lefts = -2.26 - half, half
    sides = [kl.Polygon([(a, 0), (a + 2.26, 0), (a + 2.26, 1.4), (a, 1.4)]) for a in lefts]
    pose = np.array((0.06868056100713991, -0.3350405601387271, 1.700317620071632))
    around = Surroundings(np.empty((0, COLUMNS)), Solids(sides).whole)
    x, y, _ = np.moveaxis(around.slopes(places_of(car, pose), pose, 1.5e-5, car), -1, 0)
    assert np.hypot(x, y).max() < 1.01
