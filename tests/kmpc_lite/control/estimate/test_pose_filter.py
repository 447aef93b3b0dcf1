"""Between noisy poses and what is predicted lies a better pose, and it is as sure as it says."""

from dataclasses import replace

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lab import DifferentialDrive
from kmpc_lite.control.estimate.history import DrivenPeriod
from kmpc_lite.control.estimate.pose_filter import PoseEstimate, estimate
from kmpc_lite.geometry import wrap
from kmpc_lite.model.noise_model import NoiseModel

NOISE = np.array([0.01, 0.01, np.deg2rad(0.5)])
MOVED = np.diag([2e-3, 2e-3, 4e-3]) ** 2
MODEL = kl.nominal_unicycle(0.1)
NO_PAST = np.empty((0, 2))


@pytest.mark.parametrize("command", [(0.0, 0.0), (0.5, 0.6), (-0.5, 0.0)])
def test_a_filtered_pose_is_better_than_a_measured_one_and_as_sure_as_it_says(command):
    random, u = np.random.default_rng(3), np.array(command)
    found: PoseEstimate | None = None
    errors, measured, sizes = [], [], []
    true = np.array([3.0, -2.0, 3.1])
    for k in range(400):
        pose = true + NOISE * random.normal(size=3)
        period = DrivenPeriod(pose, u, NO_PAST, True) if k else None
        found = estimate(found, period, MODEL, MOVED, np.diag(NOISE**2), pose)
        assert abs(found.pose[2] - pose[2]) < np.pi
        error = found.pose - true
        error[2] = wrap(float(error[2]))
        if k > 20:
            errors.append(error)
            measured.append(pose - true)
            sizes.append(error @ np.linalg.solve(found.covariance, error))
        slip = np.sqrt(np.diag(MOVED)) * random.normal(size=3)
        true = DifferentialDrive().trace(true, u, 0.1, 1)[-1] + slip
        true[2] = wrap(float(true[2]))
    assert np.std(errors, axis=0)[:2].max() < 0.65 * np.std(measured, axis=0)[:2].min()
    # three degrees of freedom
    assert 2.0 < np.mean(sizes) < 4.0


def test_a_controller_is_as_near_as_its_pose_is_sure():
    """Standing beside a circle, it takes back margins for the pose as more poses come."""
    noise = np.zeros((3, 3, 3))
    noise[0] = 2.0 * np.diag(NOISE**2)
    noise[1] = noise[2] = np.diag([1e-6, 1e-6, 1e-6])
    controller = kl.Controller(
        replace(MODEL, noise_model=NoiseModel(noise)), kl.NavigationProblem(), adaptation=False
    )
    random, sure = np.random.default_rng(0), []
    for _ in range(30):
        pose = NOISE * random.normal(size=3)
        controller.step(pose, (0.0, 0.0, 0.0), [kl.Circle(0.5, 0.0, 0.2)])
        felt = controller.known.margins.felt(controller.state.innovation)
        sure.append(felt.pose_error)
    assert sure[-1] < 0.6 * sure[0]
    # a pose that jumps ends the estimate
    controller.step((0.6, 0.0, 0.0), (0.0, 0.0, 0.0))
    assert controller.state.innovation.estimate is None
