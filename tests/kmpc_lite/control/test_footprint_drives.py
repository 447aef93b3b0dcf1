"""Drives of robots that are not round, judged outline to outline."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.sim.closed_loop import Outcome, Run, drive
from kmpc_lab.sim.maps.families import random_map
from kmpc_lite.errors import ScenarioError
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.gaps import obstacle_gaps

LONG = {"length": 0.8, "width": 0.3}
REAR = {"length": 0.7, "width": 0.4, "ahead": -0.2}
DOOR = [[0.0, -2.0, 0.0, -0.3, 0.1], [0.0, 0.3, 0.0, 2.0, 0.1]]


def scenario(walls: Any, start: Any, goal: Any, footprint: Any = LONG, **plant: Any) -> Scenario:
    table = {
        "map": {"bounds": [-2, -2, 2, 2], "walls": walls},
        "robot": {"footprint": footprint, "start": list(start), "goal": list(goal)},
        "plant": plant,
        "run": {"timeout": 30.0},
    }
    return Scenario.from_table(table, "cart", "cart.toml")


def driven(made: Scenario, problem: kl.NavigationProblem | None = None) -> Run:
    problem = made.problem() if problem is None else problem
    return drive(kl.Controller(kl.nominal_unicycle(0.1), problem), made)


def test_a_gap_of_half_a_metre_which_its_circle_would_not_pass() -> None:
    made = scenario(DOOR, (-1.3, 0.5, 0.0), (1.0, -0.5, 0.0))
    run = driven(made)
    assert run.outcome is Outcome.REACHED and run.clearance > 0.01
    as_circle = replace(made.problem(), footprint=None, robot_radius=made.radius)
    plan = kl.Controller(kl.nominal_unicycle(0.1), as_circle).step(
        made.start, made.goal, made.obstacles_at(0.0)
    )
    assert plan.progress is kl.GoalProgress.UNREACHABLE


def test_round_a_corner_of_a_corridor() -> None:
    # 0.9 m wide, and a right angle
    walls = [[-2, -0.5, 0.95, -0.5, 0.1], [0.95, -0.5, 0.95, 2, 0.1]]
    walls += [[-2, 0.5, -0.05, 0.5, 0.1], [-0.05, 0.5, -0.05, 2, 0.1]]
    run = driven(scenario(walls, (-1.3, 0.0, 0.0), (0.45, 1.4, np.pi / 2)))
    assert run.outcome is Outcome.REACHED and run.clearance > 0.01


def test_pose_at_the_rear_axle() -> None:
    made = scenario(DOOR, (-1.3, 0.3, 0.0), (1.0, -0.5, 0.0), {**LONG, "ahead": -0.25})
    run = driven(made)
    assert run.outcome is Outcome.REACHED and run.clearance > 0.01


def test_told_clearance_is_no_more_than_the_true_one() -> None:
    made = scenario(DOOR, (-0.6, 0.0, 0.0), (0.6, 0.0, 0.0))
    plan = kl.Controller(kl.nominal_unicycle(0.1), made.problem()).step(
        made.start, made.goal, made.obstacles_at(0.0)
    )
    poses = plan.states
    true = float(obstacle_gaps(made, poses, np.zeros(len(poses))).min())
    assert true - 0.25 * 0.15 - 1e-6 <= plan.clearance <= true + 1e-9


def larger(seed: int, family: str, footprint: Any, by: float, **plant: Any) -> Scenario | None:
    """A random map of the usual robot, larger; none if the footprint cannot stand there."""
    drawn = random_map(family, seed)
    ends = {
        key: [by * pose[0], by * pose[1], pose[2]]
        for key, pose in (("start", drawn.start), ("goal", drawn.goal))
    }
    corners = [[[by * x, by * y] for x, y in p.vertices] for p in drawn.polygons]
    table = {
        "map": {
            "bounds": [by * side for side in drawn.bounds],
            "circles": [[by * value for value in circle] for circle in drawn.circles],
            "polygons": corners,
        },
        "robot": {"footprint": footprint, **ends},
        "plant": plant,
        "run": {"timeout": 60.0, "seed": seed},
    }
    try:
        made = Scenario.from_table(table, f"{family} {seed}", "random")
    except ScenarioError:
        return None
    # the circles that cover it stick out by less than this
    poses = np.array([made.start, made.goal])
    return made if obstacle_gaps(made, poses, np.zeros(2)).min() > 0.06 else None


@pytest.mark.long
@pytest.mark.parametrize("footprint", [LONG, REAR])
@pytest.mark.parametrize("family", ["open", "dense", "polygons"])
def test_never_touches_on_random_maps(family: str, footprint: Any) -> None:
    maps = [larger(seed, family, footprint, 1.4, slip=0.05) for seed in range(61_000, 61_008)]
    runs = [driven(made) for made in maps if made is not None]
    assert len(runs) >= 5
    assert [run.outcome for run in runs] == [Outcome.REACHED] * len(runs)
    assert min(run.clearance for run in runs) > 0.0
