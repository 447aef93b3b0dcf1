"""What outlives a step copies and pickles, and rooms given a copy go on to the same bit."""

import copy
import pickle
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.margins.margins import Margins
from kmpc_lite.control.nmpc.sqp import SQP
from kmpc_lite.control.nmpc.trajectory import Trajectory, at_rest
from kmpc_lite.control.task import Task
from kmpc_lite.control.units import with_goal_weights
from kmpc_lite.control.world.surroundings import Surroundings

COPIES = [copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))]
PROBLEM = with_goal_weights(kl.NavigationProblem())
GOAL = np.array([1.4, 1.1, 0.6])
CIRCLES = things_of(np.array([[0.6, 0.5, 0.15, 0.0, 0.0], [1.0, 1.3, 0.1, 0.0, -0.05]]))


def solve(sqp: SQP, model: kl.KoopmanModel, guess: Trajectory, margins: Margins) -> Trajectory:
    task = Task(
        model,
        np.zeros((model.history, 2)),
        np.zeros(2),
        Surroundings(CIRCLES),
        reference=np.tile(GOAL, (PROBLEM.horizon + 1, 1)),
        margins=margins,
        felt=margins.calm,
    )
    return sqp.solve(guess, task).trajectory


@pytest.mark.parametrize("iterations", [1, 12])
@pytest.mark.parametrize("name", ["learned", "lagging"])
@pytest.mark.parametrize("copied", COPIES)
def test_a_solver_answers_the_same_whatever_it_solved_before_and_so_does_its_copy(
    copied: Any, name: str, iterations: int, models: dict[str, kl.KoopmanModel]
) -> None:
    model = models[name]
    margins = Margins(model, PROBLEM)
    used, fresh = (SQP(PROBLEM, model.history, iterations=iterations) for _ in range(2))
    guess = at_rest(used.qp, np.array([0.1, 0.0, 0.3]))
    first = solve(fresh, model, guess, margins)
    for heading in (0.5, -2.0, 3.0):
        solve(used, model, at_rest(used.qp, np.array([0.3, -0.2, heading])), margins)
    for sqp in (used, copied(used)):
        answer = solve(sqp, model, guess, margins)
        for mine, theirs in ((answer.states, first.states), (answer.inputs, first.inputs)):
            np.testing.assert_array_equal(mine, theirs)
        np.testing.assert_array_equal(answer.duals, first.duals)
