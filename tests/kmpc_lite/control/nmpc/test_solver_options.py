"""What the options of the solver change that a drive seldom shows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import osqp
import pytest
import scipy.sparse as sp

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.nmpc.line_search import (
    Direction,
    LineSearch,
    Penalties,
    Step,
    predict_stages,
)
from kmpc_lite.control.nmpc.osqp_workspace import osqp_settings
from kmpc_lite.control.nmpc.sqp import SQP
from kmpc_lite.control.nmpc.sqp_state import Progress, SQPState
from kmpc_lite.control.nmpc.task import Task
from kmpc_lite.control.nmpc.trajectory import Trajectory, at_rest
from kmpc_lite.control.options import OSQPOptions, SolverOptions
from kmpc_lite.control.settings import choose_passes
from kmpc_lite.control.weights import with_goal_weights

MODEL = kl.nominal_unicycle(0.1)
PROBLEM = with_goal_weights(kl.NavigationProblem())
GOAL = np.tile((1.5, 1.5, 0.0), (21, 1))
TASK = Task(MODEL, GOAL, np.empty((0, 7)), np.zeros((0, 2)), np.zeros(2))


def test_options_of_osqp_reach_it_by_its_names() -> None:
    options = OSQPOptions(1e-5, 77, 0.3, 1.2, True, 35, 4, 15)
    assert osqp_settings(options) == {
        "eps_abs": 1e-5,
        "eps_rel": 1e-5,
        "max_iter": 77,
        "rho": 0.3,
        "alpha": 1.2,
        "adaptive_rho": 1,
        "adaptive_rho_interval": 35,
        "scaling": 4,
        "check_termination": 15,
    }
    for iterations, history, name in ((1, 0, "real_time"), (1, 2, "lagging"), (2, 2, "converged")):
        solver = SolverOptions(**{name: options})
        sqp = SQP(PROBLEM, history, iterations=iterations, options=solver)
        assert sqp.workspace._osqp.settings.max_iter == 77  # type: ignore[attr-defined]


def test_rho_is_adapted_as_often_as_osqp_does_by_itself() -> None:
    own = osqp.OSQP()
    eye = sp.csc_matrix(np.eye(1))
    own.setup(eye, np.zeros(1), eye, np.zeros(1), np.zeros(1), verbose=False)
    assert SolverOptions().real_time.adaptive_rho_interval == own.settings.adaptive_rho_interval


def searches(monkeypatch: pytest.MonkeyPatch, options: SolverOptions, **more: Any) -> list[float]:
    """Lengths at which the line searches of a solve may end."""
    seen: list[float] = []
    search = LineSearch.search

    def watched(self: LineSearch, *rest: Any) -> Step:
        seen.append(rest[-1])
        return search(self, *rest)

    monkeypatch.setattr(LineSearch, "search", watched)
    sqp = SQP(PROBLEM, 0, options=options, **more)
    sqp.solve(SQPState(), at_rest(sqp.qp, np.array((0.0, 0.0, 2.5))), TASK)
    monkeypatch.setattr(LineSearch, "search", search)
    return seen


def test_line_searches_end_at_the_length_of_their_mode(monkeypatch: pytest.MonkeyPatch) -> None:
    other = SolverOptions(shortest_step=0.3, shortest_converging_step=0.02)
    for options, lengths in ((SolverOptions(), (0.1, 1e-3)), (other, (0.3, 0.02))):
        assert set(searches(monkeypatch, options)) == {lengths[0]}
        assert set(searches(monkeypatch, options, iterations=4)) == {lengths[1]}


@pytest.mark.parametrize("name", ["straight_defect", "straight_turn_defect"])
def test_a_plan_that_the_model_agrees_with_is_not_searched(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    # from rest the first linearisation is far off in positions and in headings only by rounding
    for value, count in ((1e3, 0), (1e-9, 1)):
        wide = SolverOptions(straight_defect=1e3, straight_turn_defect=1e3)
        options = replace(wide, **{name: value})
        sqp = SQP(PROBLEM, 0, options=options)
        limits = sqp._straight / (0.15, 0.15, 1.0)
        expected = (options.straight_defect,) * 2 + (options.straight_turn_defect,)
        np.testing.assert_allclose(limits, expected)
        if name == "straight_defect":
            assert len(searches(monkeypatch, options)) == count


def test_a_step_must_bring_its_share_of_the_predicted_decrease() -> None:
    sqp = SQP(PROBLEM, 0)
    guess = at_rest(sqp.qp, np.zeros(3))
    # commands that the states do not follow: the defect eats most of what the objective gains
    found = Trajectory(guess.states + (0.02, 0.02, 0.0), guess.inputs, np.zeros_like(guess.duals))
    found.states[0] = guess.states[0]
    nothing = np.zeros(PROBLEM.horizon)
    direction = Direction(
        guess, found, guess.states[1:], predict_stages(found, TASK), nothing, nothing, 0.0
    )

    def length(armijo: float, weight: float) -> float:
        search = LineSearch(sqp.qp, sqp.keep_out, armijo, lambda: 0.0)
        return search.search(Penalties(100.0, weight), direction, TASK, 0.01).length

    gained = PROBLEM.cost(guess.states, guess.inputs, GOAL) - PROBLEM.cost(
        found.states, found.inputs, GOAL
    )
    defect = np.abs(predict_stages(found, TASK) - found.states[1:]).sum()
    # penalties under which the whole step keeps 30 %, and a ten thousandth, of the decrease
    assert length(0.25, 0.7 * gained / defect) == 1.0 > length(0.36, 0.7 * gained / defect)
    usual = SolverOptions().armijo
    for kept, whole in ((1.1e-4, True), (0.9e-4, False)):
        assert (length(usual, (1.0 - kept) * gained / defect) == 1.0) is whole


def progress(sqp: SQP, depth: float, slack: float = 100.0) -> tuple[Progress, Task]:
    """Passes that get nowhere, with a plan that stands so deep in a circle [m]."""
    guess = at_rest(sqp.qp, np.zeros(3))
    things = things_of(np.array([[0.35 - depth, 0.0, 0.2, 0.0, 0.0]]))
    run = Progress(guess, 9, 1e-5, 1e-3, Penalties(slack), np.zeros(3), np.zeros(3))
    return run, replace(TASK, things=things)


def test_the_slack_penalty_grows_while_a_plan_stands_in_an_obstacle() -> None:
    other = SolverOptions(penalty_growth=7.0, largest_penalty=600.0)
    for options, growth, largest in ((SolverOptions(), 10.0, 1e5), (other, 7.0, 600.0)):
        sqp = SQP(PROBLEM, 0, iterations=9, options=options)
        for slack, grown in ((100.0, True), (0.99 * largest, True), (1.01 * largest, False)):
            run, task = progress(sqp, 3e-3, slack)
            assert sqp._has_ended(run, task) is not grown
            assert run.penalties.slack == (growth * slack if grown else slack)
            if not grown:
                continue
            assert sqp.qp.cost.slack_penalty == growth * slack
            # the last growth has not halved the depth: it must stand there
            assert sqp._has_ended(run, task)


def test_a_converged_plan_may_stand_in_an_obstacle_by_a_hundredth_of_a_millimetre() -> None:
    sqp = SQP(PROBLEM, 0, iterations=9)
    for depth, grown in ((0.95e-5, False), (1.05e-5, True)):
        run, task = progress(sqp, depth)
        assert sqp._has_ended(run, task) is not grown


def test_a_larger_robot_may_stand_in_it_deeper() -> None:
    sqp = SQP(kl.NavigationProblem(robot_radius=0.3), 0, iterations=9)
    for depth, grown in ((1.9e-5, False), (2.1e-5, True)):
        run, task = progress(sqp, depth - 0.15)
        assert sqp._has_ended(run, task) is not grown


def test_passes_to_convergence_solve_with_four_thousand_iterations_at_the_most() -> None:
    sqp = SQP(PROBLEM, 0, iterations=2)
    assert sqp.workspace._osqp.settings.max_iter == 4000  # type: ignore[attr-defined]


def test_the_exact_hessian_is_used_late_or_after_a_shortened_step() -> None:
    sqp = SQP(PROBLEM, 0, iterations=99)
    run, _ = progress(sqp, 0.0)
    used = []
    for run.passes in range(20):
        run.length = 1.0
        used.append(sqp._filler._wants_exact_hessian(run))
    assert [k for k, wanted in enumerate(used) if wanted] == [10, 12, 14, 16, 18]
    run.passes, run.length = 1, 0.5
    assert sqp._filler._wants_exact_hessian(run)


@pytest.mark.parametrize(
    ("options", "least"), [({}, 5e-5), ({"least_solve_time": 3e-4}, 3e-4)], ids=["usual", "more"]
)
def test_a_qp_gets_some_time_even_past_the_deadline(
    options: dict[str, float], least: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    sqp = SQP(PROBLEM, 0, options=SolverOptions(**options), clock=lambda: 5.0)  # type: ignore[arg-type]
    limits, solve = [], sqp.workspace.solve

    def watched(*data: np.ndarray, time_limit: float | None, **more: Any) -> Any:
        limits.append(time_limit)
        return solve(*data, **more)

    monkeypatch.setattr(sqp.workspace, "solve", watched)
    for deadline in (4.0, 5.2, np.inf):
        task = replace(TASK, deadline=deadline)
        sqp.solve(SQPState(search_time=0.1), at_rest(sqp.qp, np.zeros(3)), task)
    np.testing.assert_allclose(limits[:2], [least, 0.1])
    assert limits[2] is None


def test_more_than_0_6_radians_in_a_period_need_more_than_one_pass() -> None:
    def passes(turn: float, **settings: Any) -> list[int]:
        problem = kl.NavigationProblem(dt=1.0, u_min=(-0.6, -0.1), u_max=(0.6, turn))
        options = kl.ControllerOptions(solver=replace(SolverOptions(), long_period_passes=2))
        controller = kl.Controller(
            kl.nominal_unicycle(1.0), problem, options=options, adaptation=False, **settings
        )
        pose, used = np.zeros(3), []
        for _ in range(4):
            plan = controller.step(pose, (3.0, 2.0, 0.0))
            used.append(plan.iterations)
            pose = plan.states[1]
        return used[1:]

    quick = kl.NavigationProblem(dt=1.0, u_min=(-0.6, -0.1), u_max=(0.6, 0.61))
    assert choose_passes(quick, None, True, kl.ControllerOptions()) == 10
    assert max(passes(0.59)) == 1
    assert max(passes(0.61)) == 2
    assert max(passes(0.61, sqp_iterations=1)) == 1
    assert max(passes(0.61, guidance=False)) == 1
