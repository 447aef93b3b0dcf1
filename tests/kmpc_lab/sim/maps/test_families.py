"""Random maps: drawn again alike, within the area, and with the passage that they promise."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest
from paths import quickest_paths

from kmpc_lab.sim.maps.families import (
    BOUNDS,
    FAMILIES,
    ROBOT_RADIUS,
    has_passage,
    random_map,
)
from kmpc_lite.scenario.files import Scenario

AREA = np.array(BOUNDS)
SEEDS = range(4)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_map_has_the_passage_that_its_family_promises(family: str, seed: int) -> None:
    scenario = random_map(family, seed)
    circles, start, goal = (
        scenario.circles_at(0.0),
        np.array(scenario.start),
        np.array(scenario.goal),
    )
    clearance = ROBOT_RADIUS + FAMILIES[family].passage
    assert has_passage(circles, start, goal, clearance, AREA)
    # the guidance, which knows no grid, agrees
    radii = circles[:, 2] + clearance
    assert (
        next(quickest_paths(circles[:, :2], radii, start, goal, AREA, np.array([0.6, 0.78])), None)
        is not None
    )


@pytest.mark.parametrize("family", FAMILIES)
def test_the_same_seed_draws_the_same_map_and_another_one_another(family: str) -> None:
    assert random_map(family, 7).to_toml() == random_map(family, 7).to_toml()
    assert random_map(family, 7).start != random_map(family, 8).start
    assert random_map(family, 7).circles == random_map(family, 7, slip=0.1).circles


@pytest.mark.parametrize(
    ("family", "least", "most"), [("open", 4, 9), ("dense", 10, 14), ("narrow", 10, 14)]
)
def test_scattered_circles_are_as_many_and_as_large_as_said(
    family: str, least: int, most: int
) -> None:
    counts = set()
    for seed in range(60):
        scenario = random_map(family, seed)
        counts.add(len(scenario.circles))
        assert all(0.10 <= c.radius <= 0.28 for c in scenario.circles)
        assert (
            np.hypot(scenario.start[0] - scenario.goal[0], scenario.start[1] - scenario.goal[1])
            >= 2.0
        )
    assert min(counts) == least and max(counts) == most


def test_moving_circles_keep_to_their_speed_and_off_the_goal() -> None:
    for seed in range(15):
        scenario = random_map("moving", seed)
        moving = [c for c in scenario.circles if c.vx or c.vy]
        assert 2 <= len(moving) <= 3
        for circle in moving:
            assert 0.1 <= np.hypot(circle.vx, circle.vy) <= 0.3
            times = np.arange(0.0, 60.0, 0.05)
            away = np.hypot(
                circle.x + circle.vx * times - scenario.goal[0],
                circle.y + circle.vy * times - scenario.goal[1],
            )
            assert away.min() > circle.radius + ROBOT_RADIUS + 0.29


def test_a_trap_and_a_corridor_bar_the_straight_line() -> None:
    for family in ("trap", "corridor"):
        barred = 0
        for seed in range(10):
            scenario = random_map(family, seed)
            line = np.linspace(scenario.start[:2], scenario.goal[:2], 200)
            gaps = [np.hypot(*(line - (c.x, c.y)).T).min() - c.radius for c in scenario.circles]
            barred += min(gaps) < ROBOT_RADIUS
        assert barred >= 8, family


def test_a_map_is_a_scenario_file_like_any_other() -> None:
    scenario = random_map("moving", 2, slip=0.05)
    again = Scenario.from_table(tomllib.loads(scenario.to_toml()), scenario.name, "test")
    assert again.__dict__ == scenario.__dict__


# -- the check of the passage


def wall(gap: float) -> np.ndarray:
    """Circles across the area at x = 0 with one gap between edges, centred at y = 0."""
    radius = 0.2
    spots = gap / 2 + radius + np.arange(0.0, 2.4, radius)
    return np.array([[0.0, s * y, radius] for y in spots for s in (1, -1)])


START, GOAL = np.array([-1.0, 0.5]), np.array([1.0, -0.5])


@pytest.mark.parametrize("width", [0.3, 0.5, 0.7])
def test_a_gap_is_wide_enough_or_it_is_not(width: float) -> None:
    assert has_passage(wall(width), START, GOAL, 0.5 * width - 0.03, AREA)
    assert not has_passage(wall(width), START, GOAL, 0.5 * width + 0.001, AREA)


@pytest.mark.parametrize("seed", [500035, 7])
def test_houses_that_stand_askew_keep_start_and_goal_in_the_area(seed: int) -> None:
    scenario = random_map("rooms", seed)
    ends = np.array([scenario.start[:2], scenario.goal[:2]])
    assert np.abs(ends).max() <= 2.0
