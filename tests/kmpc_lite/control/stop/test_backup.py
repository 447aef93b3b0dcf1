"""What is left of a safe motion is driven to its end, then the robot brakes and stands."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.stop.backup import BackupState
from kmpc_lite.control.stop.safe_motion import SafeMotion, SafeMotions

MOTION = np.array([(0.4, 0.1), (0.3, 0.1), (0.1, 0.0), (0.0, 0.0)])


def test_a_motion_is_driven_to_its_end_and_then_there_is_none() -> None:
    state = BackupState()
    assert state.rest is None
    state.sent(MOTION, MOTION[0], np.zeros(3))
    for k in range(1, len(MOTION)):
        rest = state.rest
        assert rest is not None
        np.testing.assert_array_equal(rest, MOTION[k:])
        state.sent(rest, rest[0], np.full(3, float(k)))
    assert state.rest is None
    assert state.expected is not None and not state.command.any()


def test_a_copied_state_goes_on_as_the_one_it_was_copied_from() -> None:
    state = BackupState()
    state.sent(MOTION.copy(), MOTION[0], np.zeros(3))
    other = pickle.loads(pickle.dumps(state))
    np.testing.assert_array_equal(state.rest, other.rest)
    rest = state.rest
    assert rest is not None
    rest[:] = np.nan
    np.testing.assert_array_equal(state.rest, MOTION[1:])


@pytest.mark.parametrize("du_max", [(np.inf, np.inf), (1.0, 4.0)])
def test_without_a_safe_motion_the_last_one_is_driven_on(
    monkeypatch: pytest.MonkeyPatch, du_max: tuple[float, float]
) -> None:
    problem = kl.NavigationProblem(du_max=du_max)
    controller = kl.Controller(kl.nominal_unicycle(0.1), problem)
    x, circles = np.zeros(3), [kl.Circle(5.0, 5.0, 0.2)]
    for _ in range(5):
        plan = controller.step(x, (1.5, 0.0, 0.0), circles)
        x = controller.model.predict(x, plan.command)
    monkeypatch.setattr(
        SafeMotions, "find", lambda _, states, inputs, task: SafeMotion(states, inputs, None)
    )
    last = plan.command
    for _ in range(8):
        plan = controller.step(x, (1.5, 0.0, 0.0), circles)
        assert plan.status in (kl.PlanStatus.FALLBACK, kl.PlanStatus.STOPPED)
        assert plan.reason == "no way to a stop is clear"
        assert abs(plan.command[0]) < abs(last[0]) or not plan.command.any()
        last = plan.command
    assert not last.any()
