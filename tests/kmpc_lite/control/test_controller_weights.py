"""Weights that a user gives are honoured in every mode; those not given suit the mode."""

from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.problem import GOAL_Q
from kmpc_lite.control.units import (
    TRACKING_Q,
    TRACKING_R,
    with_goal_weights,
    with_tracking_weights,
)

MODEL = kl.nominal_unicycle(0.1)
MODES: list[dict[str, Any]] = [{}, {"guidance": False}]
TURNING = np.array([0.0, 0.0, 0.0]), np.array([0.9, 1.1, 1.2])


@pytest.mark.parametrize("options", MODES)
@pytest.mark.parametrize(
    "weights",
    [{"Q": (1.0, 9.0, 0.2)}, {"Q_terminal": (50.0, 50.0, 5.0)}, {"R": (0.3, 0.3)}],
)
def test_every_weight_changes_the_plan(options: dict[str, Any], weights: dict[str, Any]) -> None:
    # with guidance the terminal weight counts where the plan ends at the goal
    start, goal = (TURNING[0], 0.4 * TURNING[1]) if "Q_terminal" in weights else TURNING
    first, other = (
        kl.Controller(MODEL, problem, **options).step(start, goal)
        for problem in (kl.NavigationProblem(), kl.NavigationProblem(**weights))
    )
    assert np.abs(first.inputs - other.inputs).max() > 1e-3


@pytest.mark.parametrize("options", MODES)
def test_slack_weights_set_how_firmly_obstacles_are_kept_clear_of(options: dict[str, Any]) -> None:
    depths = []
    for weight in (0.05, 100.0):
        problem = kl.NavigationProblem(slack_weights=(weight, 1e-3))
        controller = kl.Controller(MODEL, problem, tightening=None, **options)
        # inside of the obstacle, which the plan leaves the sooner the more that costs
        plan = controller.step((0.5, 0.0, 1.6), (1.5, 0.0, 0.0), [kl.Circle(0.72, 0.0, 0.15)])
        inside = 0.3 - np.hypot(plan.states[1:, 0] - 0.72, plan.states[1:, 1])
        depths.append(np.maximum(inside, 0.0).sum())
    assert depths[1] < 0.8 * depths[0]


def test_weights_that_are_not_given_are_those_of_the_mode() -> None:
    problem = kl.NavigationProblem(R=(1.0, 2.0))
    guided, plain = with_tracking_weights(problem), with_goal_weights(problem)
    np.testing.assert_array_equal(guided.Q, np.diag(TRACKING_Q))
    np.testing.assert_array_equal(plain.Q, np.diag(GOAL_Q))
    for used in (guided, plain):
        np.testing.assert_array_equal(used.R, np.diag((1.0, 2.0)))
        assert used.margin == problem.margin
    assert not plain.Q_terminal.any()
    default = with_tracking_weights(kl.NavigationProblem())
    np.testing.assert_array_equal(default.R, np.diag(TRACKING_R))


def test_the_terminal_weight_grows_with_the_share_of_the_plan_that_is_at_the_goal() -> None:
    problem = kl.NavigationProblem()
    cost = NavigationQP(with_tracking_weights(problem), 0, 1).cost
    other = cost.P.data.copy()
    cost.set_terminal_share(0.25)
    terminal = other != cost.P.data
    assert terminal.any() and not terminal.all()
    np.testing.assert_allclose(cost.P.data[terminal], 0.25 * other[terminal])
    cost.set_terminal_share(1.0)
    np.testing.assert_array_equal(cost.P.data, other)
    # far from the goal none of it counts: another weight plans the same
    plans = [
        kl.Controller(MODEL, kl.NavigationProblem(Q_terminal=weight)).step(*TURNING)
        for weight in ((0.0, 0.0, 0.0), (50.0, 50.0, 5.0))
    ]
    np.testing.assert_array_equal(plans[0].inputs, plans[1].inputs)
