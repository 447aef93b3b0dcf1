"""Paths that a robot that is not round fits on."""

import numpy as np
from guided import GuideInUse

import kmpc_lite as kl
from kmpc_lite.control.path.capabilities import capabilities
from kmpc_lite.control.path.timed_path import TimedPath
from kmpc_lite.control.world.solids import Solids
from kmpc_lite.scenario.touch import footprint_gaps

CART = kl.Footprint.rectangle(0.8, 0.3)
PROBLEM = kl.NavigationProblem(footprint=CART, x_min=(-3, -3, -np.inf), x_max=(3, 3, np.inf))
KNOWN = capabilities(kl.nominal_unicycle(0.1), PROBLEM)
NOTHING = np.empty((0, 5))
DOOR = [kl.Wall(0, -3, 0, -0.3, 0.1), kl.Wall(0, 0.3, 0, 3, 0.1)]


def path_of(
    start: tuple[float, float, float],
    goal: tuple[float, float, float],
    walls: list[kl.Wall],
) -> tuple[TimedPath | None, str]:
    guide = GuideInUse(PROBLEM, KNOWN)
    found = guide.reference(np.array(start), np.array(goal), NOTHING, solids=Solids(walls))
    return guide.state.path, found.reason


def least_gap(path: TimedPath, walls: list[kl.Wall]) -> float:
    poses = path.at(np.arange(0.0, path.duration, 0.05))
    return float(footprint_gaps(CART, poses, np.zeros((len(poses), 0, 3)), walls).min())


def test_a_door_that_its_circle_does_not_pass() -> None:
    start, goal = (-1.5, 0.6, 0.0), (1.5, -0.6, 0.0)
    path, _ = path_of(start, goal, DOOR)
    assert path is not None and least_gap(path, DOOR) > 0.0
    narrower = [kl.Wall(0, -3, 0, -0.2, 0.1), kl.Wall(0, 0.2, 0, 3, 0.1)]
    path, why = path_of(start, goal, narrower)
    assert path is None and why == "no passage to the goal is wide enough"


CORRIDOR = [kl.Wall(-2.8, 0.3, 0.2, 0.3, 0.1), kl.Wall(-2.8, -0.3, 0.2, -0.3, 0.1)]


def test_where_it_cannot_turn_it_backs_out() -> None:
    start, goal = (-1.0, 0.0, np.pi), (1.5, 0.5, np.pi)
    path, _ = path_of(start, goal, CORRIDOR)
    assert path is not None and path.reverse
    assert least_gap(path, CORRIDOR) > 0.0
    # the same for the way in
    path, _ = path_of(goal, start, CORRIDOR)
    assert path is not None and not path.reverse
    assert least_gap(path, CORRIDOR) > 0.0


def test_a_path_is_looked_at_all_along() -> None:
    # start and goal alone would let a turn pass for which there is no space
    start, goal = (-1.0, 0.0, np.pi), (1.5, 0.5, 0.0)
    path, _ = path_of(start, goal, CORRIDOR)
    assert path is not None and least_gap(path, CORRIDOR) > 0.0
