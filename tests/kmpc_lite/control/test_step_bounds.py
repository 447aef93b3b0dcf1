"""Nothing that a step is given takes seconds or memory: it is refused where it is made, or stops.

Times are those of the processor, with bounds that only work without a bound misses.
"""

import time
import tracemalloc
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl

GOAL = (1.6, 1.2, 0.0)


@pytest.fixture
def memory() -> Iterator[Callable[[], float]]:
    """Largest memory so far [MB]."""
    tracemalloc.start()
    yield lambda: tracemalloc.get_traced_memory()[1] / 2**20
    tracemalloc.stop()


def controller(**options: Any) -> kl.Controller:
    return kl.Controller(kl.nominal_unicycle(0.1), **options)


def on_a_circle(count: int, radius: float, x: float = 0.8, y: float = 0.6) -> np.ndarray:
    angle = np.linspace(0.1, 0.1 + 2 * np.pi, count, endpoint=False)
    return np.stack([x + radius * np.cos(angle), y + radius * np.sin(angle)], axis=1)


def speckled(rows: int, columns: int, side: float) -> kl.OccupancyGrid:
    cells = np.random.default_rng(0).random((rows, columns)) < 0.2
    return kl.OccupancyGrid(cells, side, (0.5, 0.5, 0.1))


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: np.zeros((10_000, 5)), "10,000 circles: at most 1,500 are looked at"),
        (lambda: np.ones((10_000, 3)).tolist(), "10,000 obstacles: at most 1,500 circles"),
        (lambda: [kl.Wall(0, 1, 1, 1)] * 2001, "2,001 edges of polygons and walls: at most 2,000"),
        (lambda: [kl.Polygon(on_a_circle(100, 0.1))] * 21, "2,100 edges of polygons"),
        (lambda: [kl.OccupancyGrid([[0]], 0.1)] * 11, "11 grids: at most 10"),
        (lambda: [kl.OccupancyGrid(np.zeros((4096, 2100)), 0.1)] * 2, "17,203,200 cells of grids"),
        (lambda: [kl.LaserScan([1.0], 0.0, 0.1, range_max=5.0)] * 11, "11 scans: at most 10"),
        (lambda: [speckled(400, 400, 0.01)] * 2, "runs of occupied cells of grids"),
    ],
)
def test_a_step_stops_where_obstacles_are_too_many(make: Callable[[], Any], told: str) -> None:
    one, obstacles = controller(), make()
    one.step((0, 0, 0), GOAL)
    for _ in range(12):
        plan = one.step((0, 0, 0), GOAL, obstacles)
        assert plan.reason.startswith(told) or told in plan.reason
        assert plan.status in (kl.PlanStatus.FALLBACK, kl.PlanStatus.STOPPED)
    assert not plan.command.any()
    assert one.step((0, 0, 0), GOAL).status is kl.PlanStatus.SOLVED


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: kl.Polygon(on_a_circle(100_000, 1.0)), "at most 100 corners, got 100000"),
        (
            lambda: kl.OccupancyGrid(np.zeros((5000, 5000), np.int8), 0.1),
            "at most 16,777,216 cells",
        ),
        (lambda: speckled(5, 5, 1e-5), "a resolution of at least 0.0001 m, got 1e-05 m"),
        (lambda: speckled(5, 5, 1e-300), "a resolution of at least 0.0001 m"),
        (
            lambda: kl.Controller(
                kl.nominal_unicycle(0.001), kl.NavigationProblem(dt=0.001), pose_age=1.5
            ),
            "pose_age: expected a time from 0 to 1 s, got 1.5",
        ),
    ],
)
def test_what_is_too_large_is_refused_where_it_is_made(make: Callable[[], Any], told: str) -> None:
    with pytest.raises(kl.ProblemError, match=told) as refused:
        make()
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: [speckled(50, 50, 2e-4)],
        lambda: [kl.OccupancyGrid(np.eye(2, 2_000_000, dtype=bool), 2e-4, (0.3, 0.9))],
        lambda: [kl.Polygon(on_a_circle(100, 0.05, x, 0.5)) for x in np.linspace(0.5, 1.0, 20)],
        lambda: np.insert(on_a_circle(145, 0.4), 2, 0.05, axis=1),
        lambda: np.hstack([on_a_circle(1500, 1.5), np.full((1500, 3), 0.05)]),
    ],
)
def test_the_largest_that_is_taken_is_borne(make: Callable[[], Any], memory: Callable[[], float]):
    obstacles, one = make(), controller(time_budget=0.005)
    x, began = np.zeros(3), time.process_time()
    for _ in range(6):
        plan = one.step(x, GOAL, obstacles)
        assert np.isfinite(plan.command).all()
        x = plan.states[1]
    # tracing takes most of it
    assert time.process_time() - began < 20.0
    assert memory() < 250.0


def test_the_way_around_a_thousand_circles_is_found() -> None:
    wall = np.column_stack([np.full(1000, 0.8), np.linspace(-5.0, 5.0, 1000), np.full(1000, 0.05)])
    one = controller(problem=kl.NavigationProblem(x_min=(-9, -9, -np.inf), x_max=(9, 9, np.inf)))
    for _ in range(5):
        plan = one.step((0, 0, 0), GOAL, wall)
    assert plan.reachable and plan.status is kl.PlanStatus.SOLVED
