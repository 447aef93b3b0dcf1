from dataclasses import replace

import numpy as np
import pytest

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lite import Dataset, Episode, fit, nominal_unicycle
from kmpc_lite.errors import DataError
from kmpc_lite.learn.calibration import RISKS, conformal_quantile, scores, with_quantiles
from kmpc_lite.model.noise_model import NoiseModel
from kmpc_lite.model.tube import MEMORY


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


def test_scores_by_hand():
    """Straight ahead, one jolt of 3 mm forward at the second step of the only window."""
    noise = np.zeros((3, 3, 3))
    noise[1] = np.diag([1e-4, 1e-4, 0.0])
    model = replace(nominal_unicycle(0.1), noise_model=NoiseModel(noise))
    steps = np.full(MEMORY, 0.05)
    steps[1] += 0.003
    states = np.zeros((MEMORY + 1, 3))
    states[1:, 0] = np.cumsum(steps)
    found = scores(model, Dataset([Episode(states, np.tile([0.5, 0.0], (MEMORY, 1)), 0.1)]))
    # forward: variance w + 0.25 w after two steps, plus the floor of 0.1 mm
    w = 0.25e-4
    assert found == pytest.approx([0.003 / np.sqrt(1.25 * w + 1e-8)], rel=1e-6)


def test_table_falls_with_risk_and_stops_where_the_data_do():
    train, held_out = drives(0.1, 20, episodes=20, steps=200).split(0.5)
    table = with_quantiles(fit(train), held_out).info["noise_quantiles"]
    assert table["windows"] == 250 and table["steps"] == MEMORY
    assert table["risks"] == [r for r in RISKS if r >= 1 / 251]
    assert (np.diff(table["quantiles"]) >= 0).all()


def test_too_few_windows():
    train, held_out = drives(0.1, 20, episodes=4, steps=100).split(0.5)
    model = fit(train)
    assert calibrate(model, held_out, 0.001) == np.inf
    with pytest.raises(DataError, match="too few to calibrate"):
        with_quantiles(model, Dataset(held_out.episodes[:1]).windows(0.8).split(0.1)[0])
    with pytest.raises(DataError, match="no held-out episode is as long as a window of 8 steps"):
        scores(model, held_out.windows(0.5))
