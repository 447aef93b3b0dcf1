"""Omnis: commands of three numbers, through every phase of a step and every fallback."""

import pickle

import numpy as np
import pytest

import kmpc_lite as kl

MODEL = kl.nominal_omni(0.1)
FOUR = [
    kl.Circle(0.5, 0.3, 0.3),
    kl.Circle(-0.3, 0.6, 0.25),
    kl.Circle(-0.4, -0.6, 0.3),
    kl.Circle(0.7, -0.7, 0.25),
]


def drive(controller, start, goal, obstacles=(), seconds=40.0, slips=(1.0, 0.95, 1.0)):
    """Poses of a drive with mecanum wheels that slip sideways, and its last plan."""
    pose = np.array(start, dtype=float)
    poses = [pose]
    for _ in range(int(seconds / 0.1)):
        plan = controller.step(pose, goal, obstacles)
        assert plan.command.shape == (3,)
        assert (plan.command <= controller.problem.u_max + 1e-12).all()
        assert (plan.command >= controller.problem.u_min - 1e-12).all()
        if plan.holding:
            break
        pose = MODEL.predict(pose, plan.command * slips)
        poses.append(pose)
    return np.array(poses), plan


def problem(**fields):
    return kl.NavigationProblem(wheels=kl.Omni(), **fields)


def test_a_pose_that_is_lost_stops_it_and_state_goes_on_to_the_last_bit():
    controller = kl.Controller(MODEL, problem(du_max=(1.0, 1.0, 3.0)))
    poses, _ = drive(controller, (0, 0, 0), (1.5, 1.0, 1.0), FOUR, seconds=1.0)
    copy = pickle.loads(pickle.dumps(controller))
    plans = [c.step(poses[-1], (1.5, 1.0, 1.0), FOUR) for c in (controller, copy)]
    np.testing.assert_array_equal(plans[0].command, plans[1].command)
    lost = [controller.step((np.nan, 0, 0), (1.5, 1.0, 1.0), FOUR) for _ in range(20)]
    assert all(np.isfinite(plan.command).all() for plan in lost)
    assert not lost[-1].command.any()


def test_a_model_of_other_wheels_is_refused():
    with pytest.raises(kl.ProblemError, match="commands have 2 numbers"):
        kl.Controller(kl.nominal_unicycle(0.1), problem())
    with pytest.raises(kl.ProblemError, match="expected 3 numbers"):
        problem(u_min=(-1, -1))
    with pytest.raises(ValueError, match=r"expected shape \(3,\)"):
        kl.Controller(MODEL, problem()).step((0, 0, 0), (1, 0, 0), sent=(0.1, 0.0))
