"""Random maps: drawn again alike, within the area, and with the passage that they promise."""

from dataclasses import replace

import numpy as np
import pytest
from path_requests import found, request

import kmpc_lite as kl
from kmpc_lab.sim.maps import BOUNDS, FAMILIES, ROBOT_RADIUS, has_passage, random_map
from kmpc_lite.control.options import GuidanceOptions
from kmpc_lite.control.path.grid_planner import GridPlanner
from kmpc_lite.control.path.planner import Path

AREA = np.array(BOUNDS)
SEEDS = range(4)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_map_has_the_passage_that_its_family_promises(family: str, seed: int) -> None:
    scenario = random_map(family, seed)
    circles = scenario.circles_at(0.0)
    start, goal = np.array(scenario.start), np.array(scenario.goal)
    clearance = ROBOT_RADIUS + FAMILIES[family].passage
    assert has_passage(circles, start, goal, clearance, AREA)
    # the guidance agrees: 5 mm is the least that it keeps beyond a margin
    problem = kl.NavigationProblem(margin=FAMILIES[family].passage - 0.005)
    asked = replace(request(start, goal, circles[:, :3]), inflation=problem.inflation)
    assert isinstance(found(GridPlanner(problem, GuidanceOptions()), asked), Path)


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
