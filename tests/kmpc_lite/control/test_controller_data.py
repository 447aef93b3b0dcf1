"""What a step takes and gives: obstacles, arrays of the caller's own, and the clearance."""

from typing import Any

import numpy as np
import pytest
from exact_drives import DT, MODEL, RADIUS

import kmpc_lite as kl


def test_clearance_is_the_smallest_along_the_plan_as_the_obstacles_move() -> None:
    circles = [kl.Circle(0.7, 0.5, 0.15, -0.1, 0.05), kl.Circle(-1.0, 0.0, 0.3)]
    plan = kl.Controller(MODEL).step((0, 0, 0), (1.5, 1.5, 0), circles)
    times = DT * np.arange(len(plan.states))
    by_hand = min(
        float(
            (
                np.hypot(
                    plan.states[:, 0] - c.x - c.vx * times, plan.states[:, 1] - c.y - c.vy * times
                )
                - c.radius
                - RADIUS
            ).min()
        )
        for c in circles
    )
    assert plan.clearance == pytest.approx(by_hand, abs=1e-12)
    assert kl.Controller(MODEL).step((0, 0, 0), (1.5, 1.5, 0)).clearance == np.inf


def test_obstacles_may_be_circles_rows_or_arrays() -> None:
    def command(obstacles: object) -> np.ndarray:
        return kl.Controller(MODEL).step((0, 0, 0), (1.5, 1.5, 0), obstacles).command  # type: ignore[arg-type]

    expected = command([kl.Circle(0.3, 0.2, 0.1)])
    assert np.abs(expected - command([])).max() > 0.01
    for same in (
        [[0.3, 0.2, 0.1]],
        np.array([[0.3, 0.2, 0.1]]),
        np.array([[0.3, 0.2, 0.1, 0, 0]]),
        (kl.Circle(0.3, 0.2, 0.1),),
        np.float32([[0.3, 0.2, 0.1]]),
    ):
        np.testing.assert_allclose(command(same), expected, atol=1e-5)
    for nothing in ((), [], np.empty((0, 3)), np.empty((0, 5))):
        np.testing.assert_array_equal(command(nothing), command([]))


def test_callers_arrays_are_left_alone_and_results_are_the_callers_own() -> None:
    controller = kl.Controller(MODEL)
    x, goal, circles = (
        np.array([0.0, 0.0, 7.0]),
        np.array([1.5, 1.5, -9.0]),
        np.array([[0.6, 0.6, 0.15, 0.1, 0.0]]),
    )
    copies = x.copy(), goal.copy(), circles.copy()
    plan = controller.step(x, goal, circles)
    kept = plan.states.copy(), plan.inputs.copy(), plan.command.copy()
    twin = kl.Controller(MODEL)
    twin.step(x, goal, circles)
    following = np.array(MODEL.predict(x, plan.command))
    expected = twin.step(following, goal, circles)
    plan.command[:] = 0.0
    plan.command[:] = kept[2]
    second = controller.step(following, goal, circles)
    for array, copy in zip((x, goal, circles), copies, strict=True):
        np.testing.assert_array_equal(array, copy)
    for array, copy in zip((plan.states, plan.inputs, plan.command), kept, strict=True):
        np.testing.assert_array_equal(array, copy)
    np.testing.assert_array_equal(second.command, expected.command)


@pytest.mark.parametrize("wrong", [(1j, 0.0, 0.0), {}, ("a", "b", "c"), (0.0, (1.0, 2.0), 0.0)])
def test_what_is_no_numbers_raises_value_error_for_each_argument(wrong: Any) -> None:
    controller, pose = kl.Controller(MODEL), (0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="^x: expected numbers"):
        controller.step(wrong, pose)
    with pytest.raises(ValueError, match="^goal: expected numbers"):
        controller.step(pose, wrong)
    with pytest.raises(ValueError, match="^sent: expected numbers"):
        controller.step(pose, pose, sent=wrong)
