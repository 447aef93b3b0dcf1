"""What is left of a safe motion is driven to its end, then the robot brakes and stands."""

import pickle

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.estimate.history import CommandHistory
from kmpc_lite.control.stop.safe_motion import SafeMotion, SafeMotions

MOTION = np.array([(0.4, 0.1), (0.3, 0.1), (0.1, 0.0), (0.0, 0.0)])


def test_a_motion_is_driven_to_its_end_and_then_there_is_none() -> None:
    history = CommandHistory.start(kl.NavigationProblem(), 0, 0.0)
    assert history.rest is None
    history.remember(MOTION[0], MOTION.copy())
    for k in range(1, len(MOTION)):
        rest = pickle.loads(pickle.dumps(history)).rest
        np.testing.assert_array_equal(rest, MOTION[k:])
        rest[:] = np.nan
        rest = history.rest
        assert rest is not None
        np.testing.assert_array_equal(rest, MOTION[k:])
        history.remember(rest[0], rest)
    assert history.rest is None and not history.command.any()


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
