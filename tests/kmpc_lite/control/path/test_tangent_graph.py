"""Paths around circles cut nothing, are as quick as a grid says, and exist where one does."""

import numpy as np
import pytest
from paths import quickest_paths
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from kmpc_lab.sim.maps.families import has_passage
from kmpc_lite.control.path.tangent_graph import ARC_STEP, CUT_DEPTH, GeometricPath
from kmpc_lite.geometry import wrap

AREA = np.array([-2.0, -2.0, 2.0, 2.0])
SPEED = np.array([0.6, np.pi / 4])
START, GOAL = np.array([-1.9, -1.9, 0.3]), np.array([1.9, 1.9, -1.0])


def scattered(
    seed: int, least: int = 4, most: int = 14, span: float = 1.4
) -> tuple[np.ndarray, np.ndarray]:
    """Circles that leave two corners free."""
    random = np.random.default_rng(seed)
    count = int(random.integers(least, most))
    centres, radii = random.uniform(-span, span, (count, 2)), random.uniform(0.1, 0.28, count) + 0.2
    away = np.minimum(np.hypot(*(centres - START[:2]).T), np.hypot(*(centres - GOAL[:2]).T))
    return centres[away > radii], radii[away > radii]


def quickest(
    centres: np.ndarray,
    radii: np.ndarray,
    start: np.ndarray = START,
    goal: np.ndarray = GOAL,
    **options: bool,
) -> GeometricPath | None:
    return next(quickest_paths(centres, radii, start, goal, AREA, SPEED, **options), None)


def dense(points: np.ndarray) -> np.ndarray:
    share = np.linspace(0.0, 1.0, 30)[:, None, None]
    return (points[:-1] + share * np.diff(points, axis=0)).reshape(-1, 2)


@pytest.mark.parametrize("seed", range(12))
def test_a_way_cuts_no_circle_and_stays_in_the_area(seed: int) -> None:
    centres, radii = scattered(seed)
    found = list(quickest_paths(centres, radii, START, GOAL, AREA, SPEED))
    assert [w.time for w in found] == sorted(w.time for w in found)
    for way in found:
        points = dense(way.points)
        gaps = (
            np.hypot(points[:, None, 0] - centres[:, 0], points[:, None, 1] - centres[:, 1]) - radii
        )
        assert gaps.min(initial=np.inf) > -0.0025
        assert (points >= AREA[:2] - 1e-6).all() and (points <= AREA[2:] + 1e-6).all()
        assert np.allclose(way.points[[0, -1]], [START[:2], GOAL[:2]])


@pytest.mark.parametrize("seed", range(12))
def test_headings_are_those_of_the_points_and_never_jump(seed: int) -> None:
    way = quickest(*scattered(seed))
    if way is None:
        pytest.skip("no way in this map")
    step = np.diff(way.points, axis=0)
    moving = np.hypot(*step.T) > 1e-6
    between = 0.5 * (way.headings[1:] + way.headings[:-1])
    assert np.abs(wrap(np.arctan2(step[:, 1], step[:, 0]) - between)[moving]).max() < 1e-6
    assert np.abs(np.diff(way.headings)).max() <= 0.15 + 1e-9


def grid_length(centres: np.ndarray, radii: np.ndarray, cell: float = 0.05) -> float:
    """Shortest path on a grid with neighbours along axes and diagonals; infinite without one."""
    side = np.arange(-2.0, 2.0 + cell / 2, cell)
    x, y = (v.ravel() for v in np.meshgrid(side, side, indexing="ij"))
    free = (np.hypot(x[:, None] - centres[:, 0], y[:, None] - centres[:, 1]) >= radii).all(axis=1)
    number = np.arange(len(x)).reshape(len(side), len(side))
    rows, columns, lengths = [], [], []
    for a, b, length in (
        (number[1:], number[:-1], 1.0),
        (number[:, 1:], number[:, :-1], 1.0),
        (number[1:, 1:], number[:-1, :-1], 2**0.5),
        (number[1:, :-1], number[:-1, 1:], 2**0.5),
    ):
        keep = free[a.ravel()] & free[b.ravel()]
        rows.append(a.ravel()[keep])
        columns.append(b.ravel()[keep])
        lengths.append(np.full(keep.sum(), length * cell))
    graph = coo_matrix(
        (np.concatenate(lengths), (np.concatenate(rows), np.concatenate(columns))), (len(x), len(x))
    ).tocsr()
    begin, end = (int(np.argmin(np.hypot(x - p[0], y - p[1]))) for p in (START, GOAL))
    return float(dijkstra(graph, directed=False, indices=begin)[end])


@pytest.mark.parametrize("seed", range(12))
def test_the_quickest_way_is_the_shortest_where_turning_takes_no_time(seed: int) -> None:
    centres, radii = scattered(seed)
    way = next(quickest_paths(centres, radii, START, GOAL, AREA, np.array([1.0, 1e9])), None)
    on_grid = grid_length(centres, radii)
    if way is None:
        assert on_grid == np.inf or not has_passage(
            np.column_stack([centres, radii]), START, GOAL, 0.02, AREA
        )
        return
    length = np.hypot(*np.diff(way.points, axis=0).T).sum()
    assert way.time == pytest.approx(length, rel=2e-3)
    # ways on such a grid are up to 8.3 % longer than straight ones, and cut corners of circles by
    # less than a cell
    assert length <= on_grid * 1.002
    if np.isfinite(grid_length(centres, radii + 0.04)):
        assert length >= grid_length(centres, np.maximum(radii - 0.04, 0.0)) / 1.083


@pytest.mark.parametrize("seed", range(24))
def test_there_is_a_way_exactly_where_there_is_a_passage(seed: int) -> None:
    centres, radii = scattered(1000 + seed, least=12, most=26, span=2.0)
    circles = np.column_stack([centres, radii])
    way = quickest(centres, radii)
    if has_passage(circles, START, GOAL, 0.0, AREA):
        assert way is not None
    # if circles that are two cells smaller leave no passage on the grid, there is none
    if not has_passage(circles, START, GOAL, -0.05, AREA):
        assert way is None


def test_a_robot_that_looks_away_drives_backwards_unless_it_cannot() -> None:
    start, goal = np.array([-1.0, 0.0, np.pi]), np.array([1.0, 0.0, np.pi])
    assert (way := quickest(np.empty((0, 2)), np.empty(0), start, goal)) is not None and way.reverse
    forwards = quickest(np.empty((0, 2)), np.empty(0), start, goal, backward=0.0)
    assert forwards is not None and not forwards.reverse and forwards.time > way.time


def test_one_circle_in_the_middle_is_passed_on_a_line_an_arc_and_a_line() -> None:
    start, goal = np.array([-1.5, 0.0, 0.0]), np.array([1.5, 0.0, 0.0])
    way = next(
        quickest_paths(np.zeros((1, 2)), np.array([0.5]), start, goal, AREA, np.array([1.0, 1e9]))
    )
    line, arc = np.sqrt(1.5**2 - 0.5**2), 0.5 * (np.pi - 2 * np.arccos(0.5 / 1.5))
    assert way.time == pytest.approx(2 * line + arc, rel=1e-6)


def test_a_mirrored_map_has_the_mirrored_way() -> None:
    centres, radii = scattered(3)
    flip = np.array([1.0, -1.0])
    way = quickest(centres, radii)
    mirrored = quickest(centres * flip, radii, START * (1, -1, -1), GOAL * (1, -1, -1))
    assert way is not None and mirrored is not None
    assert mirrored.time == pytest.approx(way.time, rel=1e-9)
    assert np.allclose(mirrored.points, way.points * flip, atol=1e-9)
    assert np.allclose(wrap(mirrored.headings + way.headings), 0.0, atol=1e-9)


@pytest.mark.parametrize("radius", [0.3, 0.72, 50.0])
def test_a_path_around_a_large_circle_is_found_at_once(radius: float) -> None:
    """Chords of a fixed turn would cut a large circle deeper than is allowed."""
    centres, radii = np.array([[0.0, 0.02]]), np.array([radius])
    start, goal = np.array([-2.0 * radius, 0.0, 0.0]), np.array([2.0 * radius, 0.0, 0.0])
    area = np.array([-4.0, -4.0, 4.0, 4.0]) * radius
    path = next(quickest_paths(centres, radii, start, goal, area, SPEED), None)
    assert path is not None
    depth = radius - np.hypot(*(dense(path.points) - centres[0]).T).min()
    assert depth <= CUT_DEPTH
    step = np.abs(np.diff(path.headings)).max()
    assert step <= ARC_STEP + 1e-9
