"""A robot that cannot move is refused when its controller is made; one that stands tells why."""

import dataclasses
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite.control.plan import GoalProgress, Plan
from kmpc_lite.errors import ProblemError
from kmpc_lite.model.file import Ramps

START, GOAL, STEPS = np.array((-1.0, 0.0, 0.0)), (1.0, 0.5, 0.3), 200


def limited(limit: str, to: float) -> tuple[kl.KoopmanModel, dict[str, Any]]:
    """A model and a problem with one limit at a value; 0 stands for hardly more than that."""
    model, to = kl.nominal_unicycle(0.1), to or 1e-13
    both = np.full(2, to)
    if limit in ("ramps", "changes"):
        return dataclasses.replace(model, info={limit: Ramps(both, both).as_dict()}), {}
    if limit == "gains":
        return dataclasses.replace(model, H=model.H * to), {}
    return model, {
        "speed": {"u_min": (-to, -0.8), "u_max": (to, 0.8)},
        "turn rate": {"u_min": (-0.6, -to), "u_max": (0.6, to)},
        "left turns": {"u_min": (-0.6, -0.8), "u_max": (0.6, to)},
        "forwards": {"u_min": (-0.6, -0.8), "u_max": (to, 0.8)},
        "du_max": {"du_max": both},
        "du_max speed": {"du_max": (to, np.inf)},
        "du_max turn rate": {"du_max": (np.inf, to)},
        "deceleration": {"deceleration": both},
        "wheels": {"track": 0.3, "max_wheel_speed": to},
        "sight": {"sensor_range": to},
    }[limit]


LIMITS = ["speed", "turn rate", "left turns", "forwards", "du_max", "du_max speed"]
LIMITS += ["du_max turn rate", "deceleration", "wheels", "sight", "ramps", "changes", "gains"]


def drive(controller: kl.Controller, moves: bool = True) -> tuple[float, Plan]:
    robot, pose = DifferentialDrive(), START
    for _ in range(STEPS):
        plan = controller.step(pose, GOAL)
        pose = robot.step(pose, plan.command, 0.1) if moves else pose
    return float(np.abs(pose - START).max()), plan


@pytest.mark.parametrize("limit", LIMITS)
@pytest.mark.parametrize("to", [0.0, 1e-6, 1e-2])
def test_a_limit_near_zero_is_refused_or_the_robot_moves_or_it_reports_why(limit: str, to: float):
    model, fields = limited(limit, to)
    try:
        controller = kl.Controller(model, kl.NavigationProblem(**fields))
    except ProblemError as error:
        assert "would stand" in str(error) and "\n" not in str(error)
        return
    moved, plan = drive(controller)
    slow = limit in ("speed", "turn rate") and to == 1e-3  # 2 cm in 200 steps: it does move
    assert moved > (0.005 if slow else 0.02) or (
        plan.progress is GoalProgress.WAITING and "has not moved" in plan.reason
    )


def test_a_model_that_does_not_move_takes_no_other_ones_place() -> None:
    still, _ = limited("gains", 0.0)
    with pytest.raises(ProblemError, match="model: at a speed of 0.6 m/s it moves by 6e-14 m/s"):
        kl.Controller(kl.nominal_unicycle(0.1)).update_model(still)


@pytest.mark.parametrize("guidance", [True, False])
def test_a_robot_that_does_not_follow_its_commands_is_reported_as_standing(guidance: bool) -> None:
    controller = kl.Controller(kl.nominal_unicycle(0.1), guidance=guidance)
    moved, plan = drive(controller, moves=False)
    assert not moved and plan.progress is GoalProgress.WAITING
    assert "though it was commanded to, by" in plan.reason and "motors off" in plan.reason
    # another goal is a new beginning
    assert controller.step(START, (-1.0, 1.0, 0.0)).progress is GoalProgress.DRIVING


@pytest.mark.parametrize("braking, late", [(1.0, 0.5), (4.0, 0.125)])
def test_limits_that_are_given_are_ramps_of_a_model_that_was_not_learned(
    braking: float, late: float
) -> None:
    limits = {"du_max": (1.0, np.inf), "deceleration": (braking, 4.0)}
    controller = kl.Controller(kl.nominal_unicycle(0.1), kl.NavigationProblem(**limits))
    still, turning = np.zeros((1, 2)), np.array((0.1, 0.5))
    ahead, _, turned = controller.model.predict(np.zeros(3), turning, still)
    assert ahead == pytest.approx(0.01 * (1.0 - late), rel=1e-3) and turned == pytest.approx(0.05)
    # a steady speed is what it was, and another model of the same kind can take its place
    steady = controller.model.predict(np.zeros(3), (0.5, 0.0), [(0.5, 0.0)])
    assert steady[0] == pytest.approx(0.05)
    controller.update_model(kl.nominal_unicycle(0.1))
    assert controller.model.history == 1


def test_a_learned_model_keeps_what_its_log_says_of_limits() -> None:
    data = generate_dataset(DifferentialDrive(), 10, 100, dt=0.1, seed=0)
    model = kl.fit(data)
    problem = kl.NavigationProblem(du_max=(1.0, 4.0), deceleration=(1.0, 4.0))
    assert kl.Controller(model, problem).model is model
