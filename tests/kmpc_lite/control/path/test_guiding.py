"""A robot that answers late is led from where the commands that were sent will have brought it."""

from typing import Any

import numpy as np
import pytest
from lagging_robot import lagging

import kmpc_lite as kl
from kmpc_lite.control.path.guide import Guide
from kmpc_lite.control.path.situation import GuideTask

START, GOAL, LATE = np.array([0.0, 0.0, 0.3]), (3.0, 1.0, 0.0), 4


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[tuple[Any, ...]]:
    """Pose and circles that the guide is asked for, and its answer."""
    found: list[tuple[Any, ...]] = []
    answer = Guide.reference

    def listening(guide: Guide, state: Any, known: Any, task: GuideTask) -> Any:
        guidance = answer(guide, state, known, task)
        found.append((task.pose, task.circles, guidance))
        return guidance

    monkeypatch.setattr(Guide, "reference", listening)
    return found


def drive(model: kl.KoopmanModel, steps: int, obstacles: Any = ()) -> tuple[np.ndarray, list[Any]]:
    """Drive without errors; the last pose, and commands."""
    controller, pose, sent = kl.Controller(model), START, []
    for _ in range(steps):
        plan = controller.step(pose, GOAL, obstacles)
        past = np.array([*np.zeros((model.history, 2)), *sent])[-model.history :]
        pose = model.predict(pose, plan.command, past) if model.history else plan.states[1]
        sent.append(plan.command)
    controller.step(pose, GOAL, obstacles)
    return pose, sent


def test_the_guide_is_asked_from_where_what_was_sent_leads(asked: list[tuple[Any, ...]]) -> None:
    model = lagging()
    pose, sent = drive(model, 9)
    led = model.rollout(pose, np.zeros((LATE, 2)), np.array(sent[-model.history :]))
    here, _, _ = asked[-1]
    assert np.hypot(*(here - pose)[:2]) > 0.1
    np.testing.assert_allclose(here * kl.NavigationProblem().scale.state, led[-1], atol=1e-9)


def test_its_reference_begins_with_what_nothing_changes_any_more(
    asked: list[tuple[Any, ...]], monkeypatch: pytest.MonkeyPatch
) -> None:
    from kmpc_lite.control.guiding import Guiding

    given: list[Any] = []
    reference = Guiding.reference
    monkeypatch.setattr(
        Guiding,
        "reference",
        lambda *args: given.append(guidance := reference(*args)) or guidance,
    )
    model = lagging()
    pose, sent = drive(model, 9)
    led = model.rollout(pose, np.zeros((LATE, 2)), np.array(sent[-model.history :]))
    states = given[-1].states * kl.NavigationProblem().scale.state
    np.testing.assert_allclose(states[:LATE], led[:-1], atol=1e-9)
    np.testing.assert_array_equal(given[-1].states[LATE:], asked[-1][2].states[:-LATE])
