from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite import Dataset, fit
from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import conformal_quantile, fit_noise, scores, with_quantiles
from kmpc_lite.model.noise_model import NoiseModel


def calibrate(model, held_out, risk):
    return conformal_quantile(scores(model, held_out), risk)


def drives(slip, seed, episodes=60, steps=400):
    return generate_dataset(
        DifferentialDrive(slip, seed=seed), episodes=episodes, steps=steps, dt=0.1, seed=seed + 1
    )


@pytest.mark.parametrize("slip", [0.01, 0.05, 0.1, 0.2])
def test_coverage_holds_on_fresh_drives(slip):
    train, held_out = drives(slip, 20).split(0.5)
    model = fit(train)
    known = len(scores(model, held_out))
    fresh = scores(model, drives(slip, 50))
    for risk in (0.2, 0.1, 0.05, 0.01):
        rate = (fresh > calibrate(model, held_out, risk)).mean()
        # both the quantile and the rate are estimates
        spread = np.sqrt(risk * (1 - risk) * (1 / known + 1 / len(fresh)))
        assert abs(rate - risk) <= 4 * spread + 1 / known


def test_a_model_that_underestimates_its_noise_is_scaled_up():
    train, held_out = drives(0.1, 20).split(0.5)
    model = fit(train)
    timid = replace(model, noise_model=NoiseModel(model.noise_model.coefficients / 4))
    ratio = calibrate(timid, held_out, 0.05) / calibrate(model, held_out, 0.05)
    assert ratio == pytest.approx(2.0, rel=0.02)


def test_too_few_windows():
    train, held_out = drives(0.1, 20, episodes=4, steps=100).split(0.5)
    model = fit(train)
    assert calibrate(model, held_out, 0.001) == np.inf
    with pytest.raises(DataError, match="too few to calibrate"):
        with_quantiles(model, Dataset(held_out.episodes[:1]).windows(0.8).split(0.1)[0])
    with pytest.raises(DataError, match="no held-out episode is as long as a window of 8 steps"):
        scores(model, held_out.windows(0.5))


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
