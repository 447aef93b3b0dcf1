"""The way to a stop that every plan must have: clear by the model, with lag and without."""

from __future__ import annotations

import numpy as np
import pytest
from lagging_robot import BRAKING, PROBLEM, lagging, straight
from wary import slipping

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_margins import Margins
from kmpc_lite.control.stop.backup import Backup, BackupState
from kmpc_lite.control.stop.stop_task import CheckedPlan, StopTask, StopTrajectory
from kmpc_lite.control.stop.stop_trajectory import StopTrajectories


def found(
    model: kl.KoopmanModel, circles: list[list[float]], past_speed: float = 0.0, **plan: float
) -> CheckedPlan:
    past = np.tile((past_speed, 0.0), (model.history, 1))
    trajectory = straight(model, past, **plan)
    rows = np.array([[*c, *[0.0] * (5 - len(c))] for c in circles]).reshape(-1, 5)
    task = StopTask(
        model,
        past,
        np.zeros(2),
        things_of(rows),
        check=Margins(model, PROBLEM).command_check,
        drift=DriftState(),
    )
    return StopTrajectories(PROBLEM).find(trajectory.states, trajectory.inputs, task)


def test_far_from_everything_the_ramp_is_the_tail() -> None:
    assert found(kl.nominal_unicycle(0.1), [[3.0, 0.0, 0.2]]).stop == StopTrajectory()
    assert found(kl.nominal_unicycle(0.1), []).stop == StopTrajectory()


@pytest.mark.parametrize("omega", [-0.7, 0.0, 0.7])
@pytest.mark.parametrize("v", [-0.6, 0.6])
def test_without_lag_the_ramp_is_driven_exactly_where_it_is_clear(v: float, omega: float) -> None:
    model, random = kl.nominal_unicycle(0.1), np.random.default_rng(3)
    seen = set()
    for _ in range(60):
        angle, distance = random.uniform(-np.pi, np.pi), random.uniform(0.45, 0.9)
        circle = [
            distance * np.cos(angle),
            distance * np.sin(angle),
            0.2,
            *random.uniform(-0.2, 0.2, 2),
        ]
        plan = found(model, [circle], v=v, omega=omega)
        tail = plan.stop
        assert tail is not None and tail.further == 0
        commands = tail.commands(plan.inputs, BRAKING)
        if not tail.at_once:
            states = model.rollout(plan.states[0], commands)
            moments = 0.1 * np.arange(len(states))[:, None]
            gap = np.hypot(*(states[:, :2] - circle[:2] - moments * np.array(circle[3:])).T) - 0.35
            assert gap.min() > 0.0
        seen.add(tail.at_once)
        assert not commands[-1].any()
    assert seen == {False, True}


def test_a_robot_that_lags_has_a_clear_tail_or_none_at_all() -> None:
    model, random = lagging(), np.random.default_rng(5)
    outcomes = {"clear": 0, "slowed": 0, "none": 0}
    for _ in range(150):
        angle, distance = random.uniform(-1.0, 1.0), random.uniform(0.4, 1.2)
        circle = [distance * np.cos(angle), distance * np.sin(angle), 0.2]
        past_speed = random.uniform(0.0, 0.6)
        plan = found(model, [circle], past_speed)
        tail = plan.stop
        if tail is None:
            outcomes["none"] += 1
            # not even zero from now on would have kept clear of it by the margin
            states = model.rollout(
                np.zeros(3), np.zeros((6, 2)), np.tile((past_speed, 0.0), (4, 1))
            )
            assert (np.hypot(*(states[:, :2] - circle[:2]).T) - 0.35).min() < 0.03
            continue
        outcomes["slowed" if plan.slowed else "clear"] += 1
        commands = np.vstack([tail.commands(plan.inputs, BRAKING), np.zeros((4, 2))])
        states = model.rollout(np.zeros(3), commands, np.tile((past_speed, 0.0), (4, 1)))
        assert (np.hypot(*(states[:, :2] - circle[:2]).T) - 0.35).min() >= 0.0
        np.testing.assert_allclose(states[-1], states[-2], atol=1e-9)
    assert min(outcomes.values()) >= 5, outcomes


def test_a_standing_robot_that_lags_may_always_stand_and_may_leave_what_it_touches() -> None:
    model = lagging()
    for gap in (-0.05, 0.0, 0.002):
        circles = [[-0.35 - gap, 0.0, 0.2]]
        away = found(model, circles)
        assert away.stop is not None and away.inputs[0, 0] > 0.1
        towards = found(model, circles, v=-0.6)
        assert towards.stop is None or abs(towards.inputs[0, 0]) <= 0.15
        still = found(model, circles, v=0.0).stop
        assert still is not None and not still.further


def test_behind_a_slow_command_a_fast_one_needs_its_own_margin() -> None:
    model = slipping(0.2)
    check, stops = Margins(model, PROBLEM).command_check, StopTrajectories(PROBLEM)
    beside = things_of(np.array([[0.241, 0.35 + 0.02, 0.2, 0.0, 0.0]]))
    assert (
        check.step_margin(DriftState(), 0.01, 0.0)
        < 0.02
        < check.step_margin(DriftState(), 0.6, 0.0)
    )
    task = StopTask(model, np.zeros((0, 2)), np.zeros(2), beside, check=check, drift=DriftState())
    commands = np.zeros((2, 6, 2))
    commands[:, 0, 0], commands[1, 1:5, 0] = 0.01, 0.6
    clear = stops._are_clear(np.zeros(3), commands, task, check, DriftState())
    assert clear.tolist() == [True, False]


def test_beside_an_obstacle_a_robot_may_brake_but_not_drive_on() -> None:
    model = slipping(0.2)
    check, stops = Margins(model, PROBLEM).command_check, StopTrajectories(PROBLEM)
    beside = things_of(np.array([[0.0, 0.35 + 0.01, 0.2, 0.0, 0.0]]))
    assert check.step_margin(DriftState(), 0.6, 0.0) > 0.02
    task = StopTask(model, np.zeros((0, 2)), np.zeros(2), beside, check=check, drift=DriftState())
    commands = np.zeros((2, 3, 2))
    commands[:, 0, 0] = 0.6
    for strictly, expected in ((0, [True, True]), (1, [False, True])):
        clear = stops._are_clear(np.zeros(3), commands, task, check, DriftState(), strictly)
        assert clear.tolist() == expected


@pytest.mark.parametrize("others", [[], [[3.0, 0.0, 0.2, 0.5, 0.0]]])
def test_who_only_seems_to_walk_is_not_driven_up_to(others: list[list[float]]) -> None:
    model, circles = kl.nominal_unicycle(0.1), things_of(np.array(others).reshape(-1, 5))
    plan = straight(model, np.zeros((0, 2)))
    check, stops = Margins(model, PROBLEM).command_check, StopTrajectories(PROBLEM)

    def driven(gap: float) -> float:
        seems = np.array([[gap + 0.25 + PROBLEM.robot_radius, 0.0, 0.25, -0.9, 0.0]])
        none, drift = np.zeros((0, 2)), DriftState()
        task = StopTask(
            model, none, np.zeros(2), circles, check=check, drift=drift, perhaps=things_of(seems)
        )
        return float(stops.find(plan.states, plan.inputs, task).inputs[0, 0])

    # he walks 9 cm in a period
    assert driven(0.08) == 0.0
    assert 0.0 < driven(0.11) < 0.3
    assert driven(0.3) == plan.inputs[0, 0]


def test_who_was_seen_to_walk_is_let_walk_faster_by_what_is_not_known_of_his_speed() -> None:
    model, none = kl.nominal_unicycle(0.1), np.zeros((0, 2))
    plan = straight(model, none)
    check, stops = Margins(model, PROBLEM).command_check, StopTrajectories(PROBLEM)

    def driven(unsure: float) -> float:
        # 6 cm ahead of a robot, along whose way he walks
        person = np.array([[0.06 + 0.25 + PROBLEM.robot_radius, 0.0, 0.25, 0.5, 0.0]])
        task = StopTask(
            model,
            none,
            np.zeros(2),
            things_of(person, unsure, 1.0),
            check=check,
            drift=DriftState(),
        )
        return float(stops.find(plan.states, plan.inputs, task).inputs[0, 0])

    assert 0.0 < driven(0.0) < 0.3
    assert driven(0.1) == 0.0


def test_without_margins_no_plan_is_refused() -> None:
    model = kl.nominal_unicycle(0.1)
    plan, circles = (
        straight(model, np.zeros((0, 2))),
        things_of(np.array([[0.1, 0.0, 0.3, 0.0, 0.0]])),
    )
    task = StopTask(model, np.zeros((0, 2)), np.zeros(2), circles)
    checked = StopTrajectories(PROBLEM).find(plan.states, plan.inputs, task)
    assert checked.stop == StopTrajectory() and checked.inputs is plan.inputs


def test_a_plan_without_a_tail_is_not_driven_but_the_tail_before_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1))
    x, circles = np.zeros(3), [kl.Circle(5.0, 5.0, 0.2)]
    for _ in range(5):
        plan = controller.step(x, (1.5, 0.0, 0.0), circles)
        x = controller.model.predict(x, plan.command)
    monkeypatch.setattr(
        StopTrajectories, "find", lambda _, states, inputs, task: CheckedPlan(None, states, inputs)
    )
    last = plan.command
    for _ in range(8):
        plan = controller.step(x, (1.5, 0.0, 0.0), circles)
        assert plan.status in (kl.PlanStatus.FALLBACK, kl.PlanStatus.STOPPED)
        assert plan.reason == "no way to a stop is clear"
        assert abs(plan.command[0]) < abs(last[0]) or not plan.command.any()
        last = plan.command
    assert not last.any()


def test_what_is_replayed_is_what_was_found() -> None:
    backup, state, model = Backup(PROBLEM), BackupState(), kl.nominal_unicycle(0.1)
    plan = straight(model, np.zeros((0, 2)))
    tail = StopTrajectory(further=3)
    backup.accept(state, plan.states, plan.inputs, tail)
    rest = backup.replay(state)
    assert rest is not None
    np.testing.assert_array_equal(rest, tail.commands(plan.inputs, BRAKING)[1:])
