"""Omnis: commands of three numbers, through every phase of a step and every fallback."""

from __future__ import annotations

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


@pytest.mark.parametrize("fields", [{}, {"du_max": (1.0, 1.0, 3.0)}])
@pytest.mark.parametrize("heading", [0.0, 3.0])
def test_an_omni_arrives_among_circles(fields, heading):
    controller = kl.Controller(MODEL, problem(**fields))
    poses, plan = drive(controller, (-1.5, -1.5, 0.0), (1.5, 1.5, heading), FOUR)
    assert plan.holding, plan.reason
    assert np.hypot(*(poses[-1] - (1.5, 1.5, 0))[:2]) < 0.016
    for circle in FOUR:
        away = np.hypot(*(poses[:, :2] - (circle.x, circle.y)).T)
        assert away.min() > circle.radius + 0.15


def test_it_goes_sideways_without_turning():
    poses, plan = drive(kl.Controller(MODEL, problem()), (0, 0, 0), (0, 1, 0))
    assert plan.holding and np.abs(poses[:, 2]).max() < 0.02
    assert len(poses) < 26  # 1 m at 0.6 m/s


def test_sideways_through_a_gap_that_is_narrower_than_it_is_long():
    cart = kl.Footprint.rectangle(0.6, 0.3)
    walls = [kl.Wall(-2, 0, -0.42, 0, 0.02), kl.Wall(0.42, 0, 2, 0, 0.02)]
    controller = kl.Controller(MODEL, problem(footprint=cart))
    poses, plan = drive(controller, (0, -1, 0), (0, 1, 0), walls)
    assert plan.holding, plan.reason


@pytest.mark.parametrize("size", [0.1, 10.0])
def test_scaled_omnis_drive_the_same(size):
    large = problem(
        robot_radius=0.15 * size,
        u_min=(-0.6 * size, -0.6 * size, -0.8),
        u_max=(0.6 * size, 0.6 * size, 0.8),
    )
    usual = problem(u_min=(-0.6, -0.6, -0.8), u_max=(0.6, 0.6, 0.8))
    one = kl.Controller(MODEL, usual).step((0, 0, 0), (1.0, 1.0, 1.0))
    other = kl.Controller(MODEL, large).step((0, 0, 0), (size, size, 1.0))
    np.testing.assert_allclose(other.command, one.command * (size, size, 1.0), atol=2e-3 * size)


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


def test_a_model_file_keeps_its_three_inputs(tmp_path):
    MODEL.save(tmp_path / "omni.npz")
    again = kl.KoopmanModel.load(tmp_path / "omni.npz")
    assert again.inputs == 3
    np.testing.assert_array_equal(
        again.predict((0, 0, 1), (1, 2, 3)), MODEL.predict((0, 0, 1), (1, 2, 3))
    )
