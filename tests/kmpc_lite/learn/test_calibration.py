from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite import Dataset, fit
from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import conformal_quantile, scores, with_quantiles
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
