"""What becomes of a plan that the model contradicts."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab.studies.any_robot import Robot, RobotPlant
from kmpc_lab.studies.robot_drives import course_of, judge
from kmpc_lite.control.kernels.clearance import things_of
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.sqp import SQPResult
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.control.observation import Observation
from kmpc_lite.control.task import Task
from kmpc_lite.control.world.surroundings import Surroundings

MODEL = kl.nominal_unicycle(0.1)


def contradicted(circles: np.ndarray) -> tuple[kl.Controller, SQPResult, Observation, Task]:
    """A plan straight ahead whose states are nonsense, with what it is checked against."""
    controller, things = kl.Controller(MODEL), things_of(circles)
    inputs = np.tile([0.5, 0.0], (20, 1))
    plan = Trajectory(np.zeros((21, 3)), inputs, np.zeros(1))
    result = SQPResult(plan, np.zeros(3), QPStatus.SOLVED, 1, defect=0.2)
    seen = Observation(np.zeros(3), np.array([1.0, 0.0, 0.0]), things, None, None)
    margins = controller.known.margins
    assert margins is not None
    task = Task(
        MODEL,
        np.empty((0, 2)),
        np.zeros(2),
        Surroundings(things),
        margins=margins,
        felt=margins.calm,
    )
    return controller, result, seen, task


def test_its_commands_are_good_for_what_the_model_makes_of_them() -> None:
    controller, result, seen, task = contradicted(np.empty((0, 5)))
    verified = controller._pipeline._verification.check(result, seen, task)
    assert verified.trajectory is not None and verified.motion is not None
    np.testing.assert_allclose(verified.trajectory.states[-1], (1.0, 0.0, 0.0), atol=1e-9)
    np.testing.assert_allclose(verified.trajectory.states[1], (0.05, 0.0, 0.0), atol=1e-9)
    assert "contradicted the plan by 0.2" in verified.reason


@pytest.mark.parametrize("horizon", [20, 40])
def test_a_period_of_a_second_is_driven_with_any_horizon(horizon: int) -> None:
    robot = Robot("slow clock", dt=1.0, slip=0.05, learned=False)
    rows = []
    for seed in (600, 603, 604, 606):
        course = course_of(robot, seed)
        problem = replace(robot.problem(course.side), horizon=horizon)
        controller = kl.Controller(kl.nominal_unicycle(1.0), problem)
        rows.append(judge("slow clock", seed, controller, RobotPlant(robot, seed), course))
    assert not any(row.collided for row in rows)
    assert sum(row.in_pose for row in rows) >= 3
    assert np.mean([row.stopped for row in rows]) <= 0.02
