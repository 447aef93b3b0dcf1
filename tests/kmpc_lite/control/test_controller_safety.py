"""Whatever comes, what goes out is a command that is safe to send."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lite as kl

DT = 0.1
GOAL = (1.5, 1.5, 0.0)
NAN = float("nan")
PROBLEM = kl.NavigationProblem(
    u_min=(-0.2, -0.7), u_max=(0.6, 0.8)
)  # bounds that are not symmetric
MODEL = kl.nominal_unicycle(DT)
CONTROLLERS = {
    "real time": kl.Controller(MODEL, PROBLEM),
    "few slots": kl.Controller(MODEL, PROBLEM, obstacle_slots=1),
    "passes": kl.Controller(MODEL, PROBLEM, sqp_iterations=3),
    "hurried": kl.Controller(MODEL, PROBLEM, time_budget=1e-4),
}
wild = (
    st.floats()
    | st.floats(-3.0, 3.0)
    | st.sampled_from([0.0, 1.5, 1e4, -1e4, 1e12, 1e300, NAN, float("inf"), -float("inf")])
)
tame = st.floats(-2.5, 2.5)
poses = st.tuples(wild, wild, wild) | st.tuples(tame, tame, tame)
rows = st.tuples(wild, wild, wild, wild, wild) | st.tuples(
    tame, tame, st.floats(0.0, 1.0), tame, tame
)
moments = st.tuples(poses, poses, st.lists(rows, max_size=9))


def assert_safe(plan: kl.Plan, problem: kl.NavigationProblem = PROBLEM) -> None:
    """What `Plan` promises."""
    u_min, u_max, _, _ = problem.bounds
    n = problem.horizon
    assert (
        plan.command.shape == (2,)
        and plan.states.shape == (n + 1, 3)
        and plan.inputs.shape == (n, 2)
    )
    assert (
        np.isfinite(plan.command).all()
        and np.isfinite(plan.states).all()
        and np.isfinite(plan.inputs).all()
    )
    assert (plan.command >= u_min).all() and (plan.command <= u_max).all()
    assert (plan.inputs >= u_min).all() and (plan.inputs <= u_max).all()
    np.testing.assert_array_equal(plan.command, plan.inputs[0])
    assert isinstance(plan.status, kl.PlanStatus)
    # a solved plan tells a reason only where the robot does not get to its goal
    at_work = plan.progress in (kl.GoalProgress.DRIVING, kl.GoalProgress.HOLDING)
    if plan.status is not kl.PlanStatus.SOLVED or not at_work:
        assert plan.reason
    elif plan.progress is kl.GoalProgress.DRIVING:
        assert not plan.reason
    assert plan.timing["total"] >= 0.0
    assert not np.isnan(plan.clearance)


@pytest.mark.parametrize("name", CONTROLLERS)
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@settings(max_examples=30, deadline=None)
@given(drive=st.lists(moments, min_size=1, max_size=4))
def test_any_numbers_give_a_safe_plan(
    name: str, drive: list[tuple[Sequence[float], Sequence[float], list[Sequence[float]]]]
) -> None:
    controller = CONTROLLERS[name]
    controller.reset()
    for x, goal, obstacles in drive:
        plan = controller.step(x, goal, np.array(obstacles).reshape(-1, 5))
        assert_safe(plan)
        assert plan.clearance == np.inf or obstacles


@settings(max_examples=50, deadline=None)
@given(
    x=st.tuples(tame, tame, st.floats(-20, 20)),
    goal=st.tuples(tame, tame, st.floats(-20, 20)),
    obstacles=st.lists(rows, max_size=4),
)
def test_floating_point_errors_may_be_exceptions(
    x: Sequence[float], goal: Sequence[float], obstacles: list[Sequence[float]]
) -> None:
    controller = CONTROLLERS["real time"]
    controller.reset()
    with np.errstate(over="raise", divide="raise", invalid="raise"):
        for _ in range(2):
            assert_safe(controller.step(x, goal, np.array(obstacles).reshape(-1, 5)))


def test_wrong_shapes_raise_value_errors_and_change_nothing() -> None:
    controller, other = kl.Controller(MODEL), kl.Controller(MODEL)
    x = np.array([0.0, 0.0, 0.3])
    for c in (controller, other):
        x_next = MODEL.predict(x, c.step(x, GOAL).command)
    wrong = [
        ((0, 0), GOAL, ()),
        ((0, 0, 0, 0), GOAL, ()),
        ([[0, 0, 0]], GOAL, ()),
        (0.0, GOAL, ()),
        (x, (1, 1), ()),
        (x, np.zeros((3, 1)), ()),
        (x, GOAL, [1.0, 2.0, 3.0]),
        (x, GOAL, [[1.0, 2.0]]),
        (x, GOAL, np.zeros((2, 4))),
        (x, GOAL, np.zeros((2, 5, 1))),
    ]
    for arguments in wrong:
        with pytest.raises(ValueError, match="expected"):
            controller.step(*arguments)
    np.testing.assert_array_equal(
        controller.step(x_next, GOAL).command, other.step(x_next, GOAL).command
    )


def driven(
    controller: kl.Controller, periods: int, obstacles: Sequence[kl.Circle] = ()
) -> tuple[np.ndarray, kl.Plan]:
    """Drive until the robot is fast; the pose and the last plan."""
    x = np.array([0.0, 0.0, 0.7])
    for _ in range(periods):
        plan = controller.step(x, GOAL, obstacles)
        x = controller.model.predict(x, plan.command)
    return x, plan


BAD_INPUTS = {
    "NaN pose": lambda x: ((NAN, 0.0, 0.0), GOAL, ()),
    "infinite pose": lambda x: ((np.inf, x[1], x[2]), GOAL, ()),
    "pose light years away": lambda x: ((1e15, x[1], x[2]), GOAL, ()),
    "NaN heading": lambda x: ((x[0], x[1], NAN), GOAL, ()),
    "NaN goal": lambda x: (x, (1.5, NAN, 0.0), ()),
    "NaN obstacle": lambda x: (x, GOAL, [[NAN, 0.0, 0.1]]),
    "infinite radius": lambda x: (x, GOAL, [[0.0, 0.0, np.inf]]),
    "NaN velocity": lambda x: (x, GOAL, [[5.0, 0.0, 0.1, NAN, 0.0]]),
}


@pytest.mark.parametrize("name", BAD_INPUTS)
def test_without_usable_input_the_tail_is_driven_to_a_stop(name: str) -> None:
    controller = kl.Controller(MODEL)
    x, last = driven(controller, 5)
    assert last.command[0] > 0.5
    command, stopped = last.command, False
    for k in range(1, 30):
        plan = controller.step(*BAD_INPUTS[name](x))
        assert_safe(plan, controller.problem)
        assert plan.reason
        stopped |= plan.status is kl.PlanStatus.STOPPED
        # to its end the tail, which is where it stands; an obstacle that is not known hides what
        # the tail would come to
        assert plan.status is (kl.PlanStatus.STOPPED if stopped else kl.PlanStatus.FALLBACK)
        assert not (stopped and plan.command.any())
        assert stopped == (k > 6)
        if k == 1:
            np.testing.assert_allclose(plan.states[0], last.states[1], atol=2e-3)
        # brakes at least as fast as one of the two limits asks, and no faster than both
        lost = np.abs(command) - np.abs(plan.command)
        assert (lost <= np.array([1.0, 4.0]) * DT + 1e-9).all()
        assert (
            not command.any()
            or (lost >= np.minimum(np.array([1.0, 4.0]) * DT, np.abs(command)) - 1e-9).any()
        )
        # on the curve that the robot is on
        assert abs(command[0] * plan.command[1] - command[1] * plan.command[0]) < 1e-9
        command = plan.command
    assert not command.any()


@pytest.mark.parametrize("name", BAD_INPUTS)
@pytest.mark.parametrize("outage", [1, 4, 20])
def test_recovers_within_a_second_of_sane_input(name: str, outage: int) -> None:
    controller = kl.Controller(MODEL)
    x, _ = driven(controller, 5)
    for _ in range(outage):
        x = MODEL.predict(x, controller.step(*BAD_INPUTS[name](x)).command)
    start = np.hypot(*(np.array(GOAL[:2]) - x[:2]))
    for _ in range(10):
        plan = controller.step(x, GOAL)
        x = MODEL.predict(x, plan.command)
    assert plan.status is kl.PlanStatus.SOLVED
    assert np.hypot(*(np.array(GOAL[:2]) - x[:2])) < start - 0.2


@pytest.mark.parametrize("lost", ["pose", "goal"])
def test_the_rest_of_the_plan_is_not_driven_into_an_obstacle_that_has_come_up(lost: str) -> None:
    controller = kl.Controller(MODEL)
    x, last = driven(controller, 5)
    ahead = last.states[4, :2]
    pose, goal = ((NAN, 0.0, 0.0), GOAL) if lost == "pose" else (x, (NAN, 0.0, 0.0))
    plan = controller.step(pose, goal, [kl.Circle(*ahead, 0.1)])
    assert plan.status is kl.PlanStatus.STOPPED
    # the ramp would end in it
    assert not plan.command.any()
    assert (plan.clearance == np.inf) == (lost == "pose")


def test_a_controller_that_never_had_a_plan_stands() -> None:
    for name, make in BAD_INPUTS.items():
        plan = kl.Controller(MODEL).step(*make(np.zeros(3)))
        assert plan.status is kl.PlanStatus.STOPPED, name
        assert not plan.command.any()


def absurd_models() -> dict[str, kl.KoopmanModel]:
    dictionary = kl.UnicycleDictionary()
    made = {}
    for scale in (1.0, -1.0, 1e3, -1e5, 1e8, 1e12):
        ones = scale * np.ones((3, 12))
        made[f"continuous {scale:g}"] = kl.KoopmanModel(
            dictionary, DT, ones[:, :6], ones[:, :2], ones, np.eye(3), continuous=True
        )
        full = scale * np.ones((6, 12))
        made[f"discrete {scale:g}"] = kl.KoopmanModel(
            dictionary, DT, full[:, :6], full[:, :2], full, np.eye(3, 6), continuous=False
        )
    return made


@pytest.mark.parametrize("name", absurd_models())
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_absurd_models_give_safe_plans(name: str) -> None:
    controller = kl.Controller(absurd_models()[name], PROBLEM)
    for x in ([0.0, 0.0, 0.0], [0.1, 0.0, 0.1], [1.9, -1.9, 3.0]):
        assert_safe(controller.step(x, GOAL, [kl.Circle(0.5, 0.5, 0.15)]))


@pytest.mark.parametrize(
    "changes",
    [
        {"horizon": 1},
        {"Q": (1e6, 1e6, 1e6)},
        {"Q": (1e-9, 1e-9, 0.0), "Q_terminal": (1e4, 1e4, 1e4)},
        {"u_min": (0.0, -2e-3), "u_max": (6e-4, 2e-3)},
        {"u_min": (-100.0, -100.0), "u_max": (100.0, 100.0)},
        {"x_min": (-1e-3, -1e-3, -np.inf), "x_max": (1e-3, 1e-3, np.inf)},
        {"robot_radius": 0.0},
        {"margin": 5.0},
    ],
)
def test_extreme_problems_give_safe_plans(changes: dict[str, object]) -> None:
    problem = replace(PROBLEM, **changes)
    controller = kl.Controller(MODEL, problem)
    x = np.array([0.0, 0.0, 0.2])
    for _ in range(5):
        plan = controller.step(x, GOAL, [kl.Circle(0.7, 0.6, 0.2), kl.Circle(0.0, 0.0, 0.2)])
        assert_safe(plan, problem)
        x = MODEL.predict(x, plan.command)


@pytest.mark.parametrize(
    "bounds",
    [
        ((-0.6, 0.0), (0.6, 0.8)),
        ((-0.6, -0.8), (0.0, 0.8)),
        ((0.0, 0.0), (0.6, 0.8)),
        ((-0.6, -0.8), (0.6, 0.0)),
    ],
)
def test_one_sided_bounds_give_safe_plans(bounds: tuple[tuple[float, float], tuple[float, float]]):
    problem = kl.NavigationProblem(u_min=bounds[0], u_max=bounds[1])
    for options in ({}, {"guidance": False, "tightening": None}):
        controller, x = kl.Controller(MODEL, problem, **options), np.array([0.0, 0.0, 0.2])
        for _ in range(5):
            plan = controller.step(x, GOAL, [kl.Circle(0.7, 0.6, 0.2)])
            assert_safe(plan, problem)
            x = MODEL.predict(x, plan.command)


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"sqp_iterations": 0}, "sqp_iterations"),
        ({"obstacle_slots": 0}, "obstacle_slots"),
        ({"tolerance": 0.0}, "tolerance"),
        ({"time_budget": 0.0}, "time_budget"),
    ],
)
def test_wrong_options_are_refused_by_name(options: dict[str, object], word: str) -> None:
    with pytest.raises(kl.ProblemError, match=word):
        kl.Controller(MODEL, **options)  # type: ignore[arg-type]


def test_model_of_another_period_is_refused_with_both_periods() -> None:
    with pytest.raises(kl.ProblemError, match=r"0\.05 s.*0\.1 s"):
        kl.Controller(kl.nominal_unicycle(0.05), kl.NavigationProblem(dt=0.1))
    assert (
        kl.Controller(MODEL.with_dt(0.05), kl.NavigationProblem(dt=0.05))
        .step((0, 0, 0), GOAL)
        .status
        is kl.PlanStatus.SOLVED
    )


@pytest.mark.parametrize("radius", [-0.15, -1e-9, -np.inf])
def test_an_obstacle_of_negative_radius_is_not_usable(radius: float) -> None:
    plan = kl.Controller(MODEL).step((0.0, 0.0, 0.0), GOAL, [[0.6, 0.6, radius]])
    assert plan.status is kl.PlanStatus.STOPPED and "obstacle not usable" in plan.reason
    assert not plan.command.any()


def test_a_file_name_is_no_model() -> None:
    with pytest.raises(
        kl.ProblemError, match=r"expected a KoopmanModel, got str; KoopmanModel\.load"
    ):
        kl.Controller("robot.npz")  # type: ignore[arg-type]


def test_a_command_that_cannot_have_been_sent_counts_as_unknown() -> None:
    controller = kl.Controller(MODEL, pose_age=0.15)
    for sent in ((1e308, 0.0), (0.0, -1e308), (np.nan, 0.0)):
        for _ in range(3):
            plan = controller.step((0.0, 0.0, 0.0), (1.0, 1.0, 0.0), sent=sent)
            assert np.isfinite(plan.states).all() and np.abs(plan.states).max() < 10.0
            assert plan.status is kl.PlanStatus.SOLVED or plan.status is kl.PlanStatus.FEASIBLE


def test_a_robot_that_another_holds_back_loses_no_time() -> None:
    controller = kl.Controller(MODEL, PROBLEM)
    for k in range(200):
        plan = controller.step((0, 0, 0), GOAL, sent=(0, 0) if k else None)
    assert (plan.progress.name, plan.reason) == ("DRIVING", "")
