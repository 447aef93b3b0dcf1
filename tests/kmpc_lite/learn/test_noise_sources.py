"""The sources of a model's errors: found again in a log, and true of held-out errors."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.learn.noise import prediction_errors, split_noise_sources
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.noise_sources import NoiseSources, design, design_across

POSE, AT_SPEED = np.array([4e-6, 4e-6, 9e-6]), np.array([2e-4, 0.0, 0.0])
WHITE, LASTING = np.zeros((2, 3)), np.zeros((2, 3))
WHITE[0] = 4e-5, 1e-5, 0.0
WHITE[1, 2] = 1e-4
LASTING[0, 0], LASTING[1, 2] = 0.0025, 0.0036
TRUE = NoiseSources(POSE, AT_SPEED, WHITE, LASTING)


def noisy_drives(sources: NoiseSources, episodes: int, seed: int, steps: int = 12) -> kl.Dataset:
    """Short drives of a nominal robot with these sources; gains are drawn anew for each."""
    random = np.random.default_rng(seed)
    data = []
    for _ in range(episodes):
        inputs = np.repeat(random.uniform(-1.0, 1.0, (steps // 4, 2)), 4, axis=0)
        gains = random.normal(size=(2, 3)) * np.sqrt(sources.lasting)
        x, states = np.zeros(3), [np.zeros(3)]
        for u in inputs:
            white = random.normal(size=(2, 3)) * np.sqrt(sources.white)
            moved = u[0] * (0.1 * gains[0] + white[0]) + u[1] * (0.1 * gains[1] + white[1])
            moved = moved + [0.1 * u[0], 0.0, 0.1 * u[1]]
            middle = x[2] + 0.5 * moved[2]
            cos, sin = np.cos(middle), np.sin(middle)
            x = x + [cos * moved[0] - sin * moved[1], sin * moved[0] + cos * moved[1], moved[2]]
            states.append(x)
        speed = np.append(inputs[:1, 0], inputs[:, 0])
        variance = sources.pose + speed[:, None] ** 2 * sources.pose_by_speed
        noise = random.normal(size=(steps + 1, 3)) * np.sqrt(variance)
        data.append(kl.Episode(np.array(states) + noise, inputs, 0.1))
    return kl.Dataset(data)


def test_the_sources_that_made_a_log_are_found_again() -> None:
    found = split_noise_sources(kl.nominal_unicycle(0.1), noisy_drives(TRUE, 1500, 1))
    assert found is not None
    np.testing.assert_allclose(found.pose, TRUE.pose, rtol=0.3)
    for mine, true in (
        (found.pose_by_speed, TRUE.pose_by_speed),
        (found.white, TRUE.white),
        (found.lasting, TRUE.lasting),
    ):
        np.testing.assert_allclose(mine[true > 0.0], true[true > 0.0], rtol=0.35)


def test_what_is_expected_of_open_loop_errors_is_what_fresh_drives_show() -> None:
    model = kl.nominal_unicycle(0.1)
    found = split_noise_sources(model, noisy_drives(TRUE, 300, 1))
    assert found is not None
    errors, inputs = prediction_errors(model, noisy_drives(TRUE, 600, 2))
    expected = np.sqrt(found.open_loop(inputs, 0.1).mean(axis=0))
    np.testing.assert_allclose(np.sqrt((errors**2).mean(axis=0)), expected, rtol=0.15)


def test_a_heading_error_leads_aside_over_what_is_driven_afterwards() -> None:
    straight = np.tile([1.0, 0.0], (10, 1))
    across = design_across(straight, 0.1)
    np.testing.assert_allclose(across[:, 0], (0.1 * np.arange(1, 11)) ** 2)
    assert across[0, 2] == 0.0 and across[1, 2] == pytest.approx(0.01)
    own = design(straight, 0.1)
    np.testing.assert_allclose(own[:, 1], 2.0)
    np.testing.assert_allclose(own[:, 2], np.arange(1, 11))
    np.testing.assert_allclose(own[:, 4], (0.1 * np.arange(1, 11)) ** 2)


def test_a_fit_with_auto_keeps_them_in_its_file(tmp_path: Path) -> None:
    data = noisy_drives(TRUE, 60, 3, steps=60)
    model = kl.fit(data, kl.HermiteTrigDictionary(0), lags="auto")
    assert model.noise_model is not None and model.noise_model.sources is not None
    model.save(tmp_path / "robot.npz")
    again = kl.KoopmanModel.load(tmp_path / "robot.npz").noise_model
    assert again is not None and again.sources is not None
    np.testing.assert_array_equal(again.sources.as_array(), model.noise_model.sources.as_array())


def test_too_little_driving_shows_no_sources() -> None:
    assert split_noise_sources(kl.nominal_unicycle(0.1), noisy_drives(TRUE, 3, 1)) is None


@pytest.mark.parametrize(
    "change", [{"pose": -POSE}, {"white": WHITE[0]}, {"lasting": np.full((2, 3), np.nan)}]
)
def test_what_are_no_variances_is_refused(change: dict[str, np.ndarray]) -> None:
    bad = NoiseModel(np.zeros((3, 3, 3)), replace(TRUE, **change))
    with pytest.raises(kl.ModelError, match="model noise"):
        replace(kl.nominal_unicycle(0.1), noise_model=bad)
