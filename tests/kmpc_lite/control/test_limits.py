"""Limits on the change of commands.

Whatever comes, no command is farther from the one before it than allowed.
"""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lite as kl
from kmpc_lite.control.limits import LONGEST_RAMP, RateLimit

DT = 0.1
NAN = float("nan")
MODEL = kl.nominal_unicycle(DT)
STRONG = kl.NavigationProblem(u_min=(-0.2, -0.7), u_max=(0.6, 0.8), du_max=(1.5, 5.0))
WEAK = kl.NavigationProblem(du_max=(0.5, 2.0))
ONE = kl.NavigationProblem(du_max=(np.inf, 2.0))
CONTROLLERS = {
    "stronger than the brake": kl.Controller(MODEL, STRONG),
    "weaker than the brake": kl.Controller(MODEL, WEAK),
    "turning alone": kl.Controller(MODEL, ONE),
    "paper": kl.Controller(MODEL, WEAK, guidance=False, tightening=None),
    "passes": kl.Controller(MODEL, WEAK, sqp_iterations=3),
    "hurried": kl.Controller(MODEL, WEAK, time_budget=1e-4),
}
wild = st.floats(-3.0, 3.0) | st.sampled_from([0.0, 1e4, 1e300, NAN, float("inf")])
tame = st.floats(-2.0, 2.0)
poses = st.tuples(tame, tame, tame) | st.tuples(wild, wild, wild)
rows = st.tuples(tame, tame, st.floats(0.0, 0.5), tame, tame) | st.tuples(*5 * [wild])
moments = st.tuples(
    st.none() | poses, st.none() | poses, st.none() | st.lists(rows, max_size=5), st.integers(1, 6)
)


def assert_allowed(before: np.ndarray, command: np.ndarray, problem: kl.NavigationProblem) -> None:
    """The definition, speed by speed.

    `du_max`, or `deceleration` towards zero if that is more.
    """
    for a, b, change, brake in zip(
        before, command, DT * problem.du_max, DT * np.asarray(problem.deceleration), strict=True
    ):
        braked = abs(b) <= abs(a) and a * b >= 0.0
        assert abs(b - a) <= (max(change, brake) if braked else change) + 1e-8


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=12, deadline=None)
@given(drive=st.lists(moments, min_size=1, max_size=5))
def test_no_command_is_farther_from_the_one_before_than_allowed(
    name: str,
    drive: list[
        tuple[Sequence[float] | None, Sequence[float] | None, list[Sequence[float]] | None, int]
    ],
) -> None:
    controller = CONTROLLERS[name]
    controller.reset()
    # if nothing wild is commanded, the robot drives as commanded, so that commands are large
    # when something comes up
    x, goal, before = np.zeros(3), np.array([1.5, 1.0, 0.5]), np.zeros(2)
    around = np.array([[0.8, 0.3, 0.2, 0.0, 0.0]])
    for pose, target, obstacles, periods in drive:
        for _ in range(periods):
            plan = controller.step(
                x if pose is None else pose,
                goal if target is None else target,
                around if obstacles is None else np.array(obstacles).reshape(-1, 5),
            )
            assert_allowed(before, plan.command, controller.problem)
            np.testing.assert_array_equal(plan.command, plan.inputs[0])
            before, x = plan.command, MODEL.predict(x, plan.command)


@pytest.mark.parametrize("problem", [STRONG, WEAK])
def test_plans_keep_to_the_limits_in_all_stages_and_to_the_model(problem: kl.NavigationProblem):
    controller, x, before, fastest = kl.Controller(MODEL, problem), np.zeros(3), np.zeros(2), 0.0
    for _ in range(40):
        plan = controller.step(x, (1.5, 0.7, 0.5), [kl.Circle(0.8, 0.2, 0.15)])
        assert plan.status in (kl.PlanStatus.SOLVED, kl.PlanStatus.FEASIBLE)
        changes = np.abs(np.diff(np.vstack([before, plan.inputs]), axis=0))
        # the rows of the QP are kept to OSQP's tolerance
        assert (changes <= DT * np.maximum(problem.du_max, problem.deceleration) + 0.02).all()
        model = controller.model
        next_state = model.predict(plan.states[0], plan.command, before[None][: model.history])
        np.testing.assert_allclose(next_state, plan.states[1], atol=0.02)
        before, x = plan.command, next_state
        fastest = max(fastest, float(plan.command[0]))
    assert fastest > 0.5


def test_the_limit_keeps_the_direction_of_the_change_and_brakes_harder_than_it_speeds_up() -> None:
    limit = RateLimit(WEAK)
    last = np.array([0.3, 0.4])
    np.testing.assert_allclose(limit.limit(np.array([0.5, 0.4]), last), [0.35, 0.4])
    np.testing.assert_allclose(limit.limit(np.array([0.4, 0.5]), last), [0.35, 0.45])
    # towards zero at the deceleration (1, 4), and not through zero at once
    np.testing.assert_allclose(limit.limit(np.zeros(2), last), [0.2, 0.4 - 0.4 / 3])
    np.testing.assert_allclose(
        limit.limit(np.array([-0.6, 0.0]), np.array([0.08, 0.0])), [0.0, 0.0], atol=1e-12
    )
    inside = np.array([0.31, 0.3])
    assert limit.limit(inside, last) is inside


@given(
    v=st.floats(-0.6, 0.6),
    omega=st.floats(-0.78, 0.78),
    dt=st.floats(0.01, 1.0),
    limit_v=st.floats(0.1, 5.0),
    limit_w=st.floats(0.1, 9.0),
)
def test_ramp_ends_at_zero_within_the_limits_on_the_curve(
    v: float, omega: float, dt: float, limit_v: float, limit_w: float
) -> None:
    command, limits = np.array([v, omega]), np.array([limit_v, limit_w]) * dt
    problem = kl.NavigationProblem(dt=dt, deceleration=(limit_v, limit_w))
    rates = RateLimit(problem)
    commands = rates.ramp(command)
    periods = max(abs(v) / limits[0], abs(omega) / limits[1])
    assert len(commands) == max(1, int(np.ceil(periods - 1e-9))) <= rates.longest_ramp
    assert not commands[-1].any()
    all_of_them = np.vstack([command, commands])
    assert (np.diff(np.abs(all_of_them), axis=0) <= 1e-12).all()
    np.testing.assert_allclose(all_of_them[:, 0] * omega, all_of_them[:, 1] * v, atol=1e-9)
    assert (np.abs(np.diff(all_of_them, axis=0)) <= limits * (1 + 1e-6) + 1e-9).all()


def test_no_robot_is_asked_for_more_than_it_brakes() -> None:
    slow, quick = {"u_max": (4.0, 0.5), "deceleration": (0.1, 0.1)}, {"du_max": (2.0, 8.0)}
    for given_, name, kept in (
        (slow, "u_max", [LONGEST_RAMP * 0.1, 0.5]),
        (quick, "deceleration", [2.0, 8.0]),
        ({**quick, "deceleration": (0.5, 9.0)}, "du_max", [0.5, 8.0]),
        ({"deceleration": (0.5, 9.0)}, "du_max", [0.5, 9.0]),
    ):
        problem = kl.Controller(MODEL, kl.NavigationProblem(**given_)).problem
        assert getattr(problem, name).tolist() == kept
