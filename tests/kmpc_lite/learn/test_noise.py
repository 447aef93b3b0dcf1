"""The residual covariance: what made the noise is found again, and every covariance is one."""

from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.learn.calibration import fit_noise

# covariances per period of (forward [m], left [m], heading [rad]): at rest, by v^2, by omega^2
REST = np.array([[4.0, 1.0, 0.5], [1.0, 2.0, -0.3], [0.5, -0.3, 1.0]]) * 5e-5
BY_SPEED = np.array([[9.0, -3.0, 1.0], [-3.0, 6.0, 2.0], [1.0, 2.0, 5.0]]) * 1e-4
BY_TURN = np.array([[1.0, 0.2, 0.4], [0.2, 3.0, 0.8], [0.4, 0.8, 8.0]]) * 1e-4


def noisy_drives(
    rest: np.ndarray, by_speed: np.ndarray, by_turn: np.ndarray, steps: int, seed: int = 0
) -> kl.Dataset:
    """Single steps of a nominal robot from anywhere, each end moved by noise in the frame of
    its start.
    """
    random = np.random.default_rng(seed)
    x, u = random.uniform(-3.0, 3.0, (steps, 3)), random.uniform(-1.0, 1.0, (steps, 2))
    roots = [np.linalg.cholesky(s + 1e-18 * np.eye(3)) for s in (rest, by_speed, by_turn)]
    scales = [np.ones(steps), u[:, 0], u[:, 1]]
    noise = sum(
        scale[:, None] * (random.normal(size=(steps, 3)) @ root.T)
        for scale, root in zip(scales, roots, strict=True)
    )
    cos, sin = np.cos(x[:, 2]), np.sin(x[:, 2])
    moved = np.stack(
        [cos * noise[:, 0] - sin * noise[:, 1], sin * noise[:, 0] + cos * noise[:, 1], noise[:, 2]],
        axis=1,
    )
    ends = kl.nominal_unicycle(0.1).predict(x, u) + moved
    return kl.Dataset(
        [kl.Episode(np.stack([a, b]), c[None], 0.1) for a, b, c in zip(x, ends, u, strict=True)]
    )


def commands() -> np.ndarray:
    """Commands all over the range, and beyond."""
    return np.stack(np.meshgrid(np.linspace(-2, 2, 9), np.linspace(-2, 2, 9)), axis=-1)


def test_a_known_covariance_is_recovered() -> None:
    noise = fit_noise(kl.nominal_unicycle(0.1), noisy_drives(REST, BY_SPEED, BY_TURN, 24_000))
    for found, true in zip(noise.coefficients, (REST, BY_SPEED, BY_TURN), strict=True):
        assert np.linalg.norm(found - true) < 0.07 * np.linalg.norm(true)
    u = commands()
    true = REST + u[..., :1, None] ** 2 * BY_SPEED + u[..., 1:, None] ** 2 * BY_TURN
    error = np.linalg.norm(noise.covariance(u) - true, axis=(-2, -1))
    assert (error < 0.05 * np.linalg.norm(true, axis=(-2, -1))).all()


def test_the_slip_of_the_paper_is_recovered() -> None:
    # alpha, beta and gamma exponential: each has the mean and the standard deviation lambda
    slip, dt = 0.05, 0.1
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(slip), episodes=200, steps=250, dt=dt, seed=1
    )
    noise = kl.fit(data).noise([1.0, 0.0])
    np.testing.assert_allclose(np.sqrt(np.diag(noise)[:2]), slip * dt, rtol=0.05)
    turning = kl.fit(data).noise([0.0, 1.0])
    assert np.sqrt(turning[2, 2]) == pytest.approx(slip * dt, rel=0.05)
    assert np.sqrt(turning[0, 0]) < 0.25 * slip * dt and np.sqrt(noise[2, 2]) < 0.25 * slip * dt


@pytest.mark.parametrize("method", ["integral", "edmdc"])
@pytest.mark.parametrize("seed", range(5))
def test_every_covariance_is_positive_semidefinite(method: Any, seed: int) -> None:
    # few samples: the plain regression would leave negative eigenvalues
    data = kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(0.1, seed), episodes=2, steps=25, dt=0.1, seed=seed
    )
    model = kl.fit(data, method=method)
    s = model.noise(commands())
    assert s.shape == (9, 9, 3, 3) and np.array_equal(s, s.swapaxes(-1, -2))
    values = np.linalg.eigvalsh(s)
    assert (values >= -1e-15 * values.max()).all() and values.max() > 0.0


def test_noise_that_shrinks_with_the_command_is_not_overstated() -> None:
    # no covariance falls with omega^2, so the best of them is constant: the mean, not what was seen
    # at rest
    random = np.random.default_rng(2)
    x, u = random.uniform(-3.0, 3.0, (15_000, 3)), random.uniform(-1.0, 1.0, (15_000, 2))
    ends = kl.nominal_unicycle(0.1).predict(x, u) + np.sqrt(1.2 - u[:, 1:] ** 2) * random.normal(
        scale=0.01, size=x.shape
    )
    data = kl.Dataset(
        [kl.Episode(np.stack([a, b]), c[None], 0.1) for a, b, c in zip(x, ends, u, strict=True)]
    )
    found = fit_noise(kl.nominal_unicycle(0.1), data).covariance(commands()[2:7, 2:7])
    np.testing.assert_allclose(
        found, np.broadcast_to(1e-4 * (1.2 - 1 / 3) * np.eye(3), found.shape), atol=5e-6
    )
