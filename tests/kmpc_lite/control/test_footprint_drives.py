"""Drives of robots that are not round, judged outline to outline."""

from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.gaps import obstacle_gaps

LONG = {"length": 0.8, "width": 0.3}
DOOR = [[0.0, -2.0, 0.0, -0.3, 0.1], [0.0, 0.3, 0.0, 2.0, 0.1]]


def scenario(walls: Any, start: Any, goal: Any, footprint: Any = LONG, **plant: Any) -> Scenario:
    table = {
        "map": {"bounds": [-2, -2, 2, 2], "walls": walls},
        "robot": {"footprint": footprint, "start": list(start), "goal": list(goal)},
        "plant": plant,
        "run": {"timeout": 30.0},
    }
    return Scenario.from_table(table, "cart", "cart.toml")


def test_the_reported_clearance_is_no_more_than_the_true_one() -> None:
    made = scenario(DOOR, (-0.6, 0.0, 0.0), (0.6, 0.0, 0.0))
    plan = kl.Controller(kl.nominal_unicycle(0.1), made.problem()).step(
        made.start, made.goal, made.obstacles_at(0.0)
    )
    poses = plan.states
    true = float(obstacle_gaps(made, poses, np.zeros(len(poses))).min())
    assert true - 0.25 * 0.15 - 1e-6 <= plan.clearance <= true + 1e-9
