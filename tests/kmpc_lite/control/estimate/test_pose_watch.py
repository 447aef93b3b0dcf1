"""Which poses count as jumps for the paper's robot, looked at on both sides of each limit."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.control.estimate.innovation import Innovation, InnovationState
from kmpc_lite.control.options import PoseOptions
from kmpc_lite.types import Array

GOAL = (1.8, 0.0, 0.0)


def jumps(commands: list[tuple[float, float]], ahead: float = 0.0, turned: float = 0.0) -> bool:
    """Whether a pose that is off by this, after commands, counts as a jump."""
    controller, pose = kl.Controller(kl.nominal_unicycle(0.1)), (0.0, 0.0, 0.0)
    controller.step(pose, GOAL)
    for v, omega in commands[:-1]:
        x, y, heading = pose
        heading += 0.1 * omega
        pose = x + 0.1 * v * math.cos(heading), y + 0.1 * v * math.sin(heading), heading
        controller.step(pose, GOAL, sent=(v, omega))
    v, omega = commands[-1]
    pose = pose[0] + 0.1 * v + ahead, pose[1], pose[2] + 0.1 * omega + turned
    return controller.step(pose, GOAL, sent=(v, omega)).reason.startswith("the pose jumped")


def test_a_pose_that_stays_is_believed_after_two_seconds() -> None:
    controller, waited = kl.Controller(kl.nominal_unicycle(0.1)), 0
    controller.step((0.0, 0.0, 0.0), GOAL)
    for _ in range(30):
        plan = controller.step((0.5, 0.3, 0.0), GOAL, sent=(0.0, 0.0))
        waited += plan.reason.startswith("the pose jumped")
    assert waited == pytest.approx(20, abs=1)


@pytest.mark.parametrize("pose", [None, np.array([0.0, 9.0, 0.0])], ids=["lost", "doubted"])
def test_a_model_that_drifts_out_of_all_numbers_is_not_followed(pose: Array | None) -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1))
    problem, history = controller.units, controller.state.history
    margins = controller.known.margins
    assert margins is not None
    innovation, state = Innovation(problem, PoseOptions()), InnovationState()
    history.measured = np.zeros(3)
    if pose is not None:
        state.believed = np.zeros(3)
    history.remember(np.zeros(2))
    runaway = SimpleNamespace(predict=lambda *_: np.full(3, np.inf))
    noise = margins.noise.pose_errors
    assert innovation.see(state, history, runaway, noise, pose) is None
    assert state.believed is None and history.measured is pose
