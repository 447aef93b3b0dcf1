"""What each option of the stop trajectories changes: where one begins to count, and by how much."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from lagging_robot import BRAKING, PROBLEM, lagging, straight

import kmpc_lite as kl
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.model_margins import Margins
from kmpc_lite.control.options import StopOptions
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.control.stop.quick_look import QuickLook
from kmpc_lite.control.stop.stop_task import CheckedPlan, StopTask, StopTrajectory
from kmpc_lite.control.stop.stop_trajectory import StopTrajectories


def task(model: kl.KoopmanModel, circle: list[float], past_speed: float = 0.0) -> StopTask:
    return StopTask(
        model,
        np.tile((past_speed, 0.0), (model.history, 1)),
        np.zeros(2),
        things_of(np.array([[*circle, 0.0, 0.0]])),
        check=Margins(model, PROBLEM).command_check,
        drift=DriftState(),
    )


def scenes(options: StopOptions, count: int = 150) -> list[CheckedPlan]:
    """Plans of a robot that lags, checked beside circles at random."""
    model, random, found = lagging(), np.random.default_rng(5), []
    for _ in range(count):
        angle, distance = random.uniform(-1.0, 1.0), random.uniform(0.4, 0.9)
        circle = [distance * np.cos(angle), distance * np.sin(angle), 0.2]
        asked = task(model, circle, random.uniform(0.0, 0.6))
        plan = straight(model, asked.past)
        plan.inputs[1:, 1] = -0.7 * np.sign(angle)
        states = model.rollout(np.zeros(3), plan.inputs, asked.past)
        found.append(StopTrajectories(PROBLEM, options).find(states, plan.inputs, asked))
    return found


def test_the_rest_of_the_plan_is_tried_for_as_long_as_it_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried: list[int] = []

    def refuse(_: StopTrajectories, here: np.ndarray, commands: np.ndarray, *rest: Any) -> Any:
        tried.append(len(commands))
        return np.zeros(len(commands), dtype=bool)

    monkeypatch.setattr(StopTrajectories, "_are_clear", refuse)
    for options, further in (({}, 5), ({"further_time": 0.6}, 6), ({"further_time": 0.2}, 2)):
        tried.clear()
        assert any(plan.stop is None for plan in scenes(StopOptions(**options), 20))
        # the whole command alone, then it and what may follow, then its shares
        assert set(tried) == {1, further + 3}


def test_commands_are_slowed_to_the_shares_that_are_told() -> None:
    usual = (0.5, 0.25, 0.0)
    for options, shares in (({}, usual), ({"slower_shares": (0.6, 0.2, 0.1)}, (0.6, 0.2, 0.1))):
        plans = scenes(StopOptions(further_time=0.0, **options))
        seen = {round(float(p.inputs[0, 0]) / 0.6, 9) for p in plans if p.slowed and p.stop}
        assert set(shares) <= seen


@pytest.mark.parametrize("spend", [0.25, 0.5])
def test_a_robot_near_an_obstacle_may_spend_a_share_of_its_clearance(spend: float) -> None:
    model, clearance = kl.nominal_unicycle(0.1), 0.004
    asked, stops = (
        task(model, [0.35 + clearance, 0.0, 0.2]),
        StopTrajectories(PROBLEM, StopOptions(spend_share=spend)),
    )
    assert asked.check is not None and asked.drift is not None
    for part, clear in ((0.95, True), (1.05, False)):
        driven = part * spend * clearance
        commands = np.array([[[driven / 0.1, 0.0], [0.0, 0.0]]])
        found = stops._are_clear(np.zeros(3), commands, asked, asked.check, asked.drift)
        assert found.tolist() == [clear]


def test_only_what_is_sure_of_a_clearance_may_be_spent() -> None:
    """With poses that err by 2 mm (95 %), of 4 mm that are measured 2 may be shared out."""
    model, clearance, sure = kl.nominal_unicycle(0.1), 0.004, 0.002
    asked = task(model, [0.35 + clearance, 0.0, 0.2])
    stops = StopTrajectories(PROBLEM, StopOptions(spend_share=0.25))
    assert asked.check is not None and asked.drift is not None
    for error in (clearance - sure, 2.0 * clearance):
        asked.check.pose_error = error
        spent = 0.25 * max(clearance - error, 0.0)
        for driven, clear in ((0.0, True), (0.95 * spent, True), (spent + 1e-4, False)):
            commands = np.array([[[driven / 0.1, 0.0], [0.0, 0.0]]])
            found = stops._are_clear(np.zeros(3), commands, asked, asked.check, asked.drift)
            assert found.tolist() == [clear]


@pytest.mark.parametrize("limit", [0.05, 0.2])
def test_a_command_that_may_hardly_drive_turns_on_the_spot(limit: float) -> None:
    model = kl.nominal_unicycle(0.1)
    plan = straight(model, np.zeros((0, 2)), omega=0.5)
    stops = StopTrajectories(PROBLEM, StopOptions(turn_only_share=limit))
    for share, turn in ((1.02 * limit, 1.02 * limit * 0.5), (0.98 * limit, 0.5)):
        checked = CheckedPlan(StopTrajectory(), plan.states, plan.inputs)
        slowed = stops._slowed(checked, share, 1.0, task(model, [1.0, 0.0, 0.2]))
        np.testing.assert_allclose(slowed.inputs[0], (share * 0.6, turn))


@pytest.mark.parametrize(("options", "overspeed"), [({}, 1.25), ({"overspeed": 1.8}, 1.8)])
def test_what_is_far_is_not_looked_at(
    options: dict[str, float], overspeed: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    model, looks = kl.nominal_unicycle(0.1), []
    monkeypatch.setattr(QuickLook, "ramp_is_clear", lambda *rest: bool(looks.append(rest)) or True)
    plan = straight(model, np.zeros((0, 2)))
    stops = StopTrajectories(PROBLEM, StopOptions(**options))
    kept = 0.005 + 0.001  # of the solver, and of the command check
    for beyond, expected in ((1e-3, 0), (-1e-3, 1)):
        looks.clear()
        distance = overspeed * BRAKING.distance(0.6, BRAKING.periods(0.6, 0.0)) + kept + beyond
        stops.find(plan.states, plan.inputs, task(model, [0.35 + distance, 0.0, 0.2]))
        assert len(looks) == expected


@pytest.mark.parametrize(
    ("options", "fixed", "share"),
    [
        ({}, 0.005, 0.05),
        ({"quick_look_error": 0.1}, 0.015, 0.05),
        ({"quick_look_error_share": 0.2}, 0.005, 0.2),
    ],
)
def test_the_quick_look_keeps_its_error_beyond_the_margin(
    options: dict[str, float], fixed: float, share: float
) -> None:
    model, wanted = lagging(), StopOptions(**options)  # type: ignore[arg-type]
    look = QuickLook(PROBLEM, Braking(PROBLEM, wanted), wanted)
    command, past = np.array([0.4, 0.0]), np.zeros((4, 2))
    ramp = BRAKING.ramp(command)
    commands = np.vstack([command, ramp, np.zeros((4, 2))])
    end = float(model.rollout(np.zeros(3), commands, past)[-1, 0])
    error = fixed + share * end
    states, clearance = np.zeros((21, 3)), 0.1
    circles = things_of(np.array([[end + 0.35 + clearance, 0.0, 0.2, 0.0, 0.0]]))
    for margin, clear in ((clearance - error - 1e-4, True), (clearance - error + 1e-4, False)):
        assert look.lagging_ramp_is_clear(model, states, command, past, circles, margin) is clear
