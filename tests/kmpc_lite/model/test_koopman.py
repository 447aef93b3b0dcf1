"""The bilinear model: prediction, rollout and linearisation agree, at any period."""

from dataclasses import replace

import numpy as np
import pytest
from any_model import DICTIONARIES, UNICYCLE, every_model, points, random_model

import kmpc_lite as kl
from kmpc_lite.model.noise_model import NoiseModel


def by_the_book(
    model: kl.KoopmanModel, x: np.ndarray, u: np.ndarray, past: np.ndarray
) -> np.ndarray:
    """The paper's eq. 12 with the Kronecker product written out, and textbook Runge-Kutta or
    midpoint for the generator.
    """
    w = model.dictionary.inputs(u, past)

    def f(state: np.ndarray) -> np.ndarray:
        z = model.dictionary.lift(state)
        return model.C @ (model.A @ z + model.B @ w + model.H @ np.kron(w, z))

    if not model.continuous:
        return f(x)
    k1 = f(x)
    k2 = f(x + model.dt / 2 * k1)
    if model.integrator == "midpoint":
        return x + model.dt * k2
    k3 = f(x + model.dt / 2 * k2)
    k4 = f(x + model.dt * k3)
    return x + model.dt / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


@every_model
def test_predict_is_the_bilinear_equation(model: kl.KoopmanModel) -> None:
    for seed in range(5):
        x, u, past = points(model, seed=seed)
        np.testing.assert_allclose(
            model.predict(x, u, past), by_the_book(model, x, u, past), rtol=1e-11, atol=1e-12
        )


@every_model
def test_a_rollout_is_repeated_prediction(model: kl.KoopmanModel) -> None:
    x, _, past = points(model)
    inputs = 0.3 * np.random.default_rng(2).normal(size=(6, 2))
    states = model.rollout(x, inputs, past)
    commands = np.vstack([past, inputs])
    assert states.shape == (7, 3)
    np.testing.assert_array_equal(states[0], x)
    for k, u in enumerate(inputs):
        np.testing.assert_allclose(
            states[k + 1], model.predict(states[k], u, commands[k : k + model.history]), rtol=1e-12
        )


@every_model
def test_linearize_gives_prediction_and_its_derivatives(model: kl.KoopmanModel) -> None:
    step = 1e-6
    for seed in range(3):
        x, u, past = points(model, seed=seed)
        at = model.linearize(x, u, past)
        np.testing.assert_allclose(at.value, model.predict(x, u, past), rtol=1e-12, atol=1e-13)
        assert (
            at.A.shape == (3, 3)
            and at.B.shape == (3, 2)
            and at.B_past.shape == (model.history, 3, 2)
        )
        for i in range(3):
            d = step * np.eye(3)[i]
            slope = (model.predict(x + d, u, past) - model.predict(x - d, u, past)) / (2 * step)
            np.testing.assert_allclose(at.A[:, i], slope, rtol=1e-6, atol=1e-7)
        for i in range(2):
            d = step * np.eye(2)[i]
            slope = (model.predict(x, u + d, past) - model.predict(x, u - d, past)) / (2 * step)
            np.testing.assert_allclose(at.B[:, i], slope, rtol=1e-6, atol=1e-7)
            for age in range(model.history):
                moved = np.zeros_like(past)
                moved[-1 - age, i] = step
                slope = (model.predict(x, u, past + moved) - model.predict(x, u, past - moved)) / (
                    2 * step
                )
                np.testing.assert_allclose(at.B_past[age, :, i], slope, rtol=1e-6, atol=1e-7)


@every_model
@pytest.mark.parametrize("lead", [(20,), (2, 3), (0,)])
def test_a_batch_is_many_singles(model: kl.KoopmanModel, lead: tuple[int, ...]) -> None:
    x, u, past = points(model, *lead)
    inputs = 0.3 * np.random.default_rng(3).normal(size=(*lead, 4, 2))
    predicted, paths, at = (
        model.predict(x, u, past),
        model.rollout(x, inputs, past),
        model.linearize(x, u, past),
    )
    assert predicted.shape == at.value.shape == (*lead, 3) and paths.shape == (*lead, 5, 3)
    assert (
        at.A.shape == (*lead, 3, 3)
        and at.B.shape == (*lead, 3, 2)
        and at.B_past.shape == (*lead, model.history, 3, 2)
    )
    close = {"rtol": 1e-11, "atol": 1e-12}
    for i in np.ndindex(lead):
        np.testing.assert_allclose(predicted[i], model.predict(x[i], u[i], past[i]), **close)
        np.testing.assert_allclose(paths[i], model.rollout(x[i], inputs[i], past[i]), **close)
        for many, one in zip(at, model.linearize(x[i], u[i], past[i]), strict=True):
            np.testing.assert_allclose(many[i], one, **close)


def test_noise_grows_with_the_command() -> None:
    s = np.array([1e-4, 2e-4, 3e-4])[:, None, None] * np.eye(3)
    model = replace(kl.nominal_unicycle(0.1), noise_model=NoiseModel(s))
    commands = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, -3.0], [2.0, 3.0]])
    expected = (1e-4 + 2e-4 * commands[:, 0] ** 2 + 3e-4 * commands[:, 1] ** 2)[
        :, None, None
    ] * np.eye(3)
    np.testing.assert_allclose(model.noise(commands), expected)
    np.testing.assert_allclose(model.noise(commands[3]), expected[3])
    assert not kl.nominal_unicycle(0.1).noise(commands).any()
    for wrong in (0.5, np.zeros(3)):
        with pytest.raises(ValueError, match="commands"):
            model.noise(wrong)


def test_another_period_gives_the_same_drive() -> None:
    quantiles = {"risks": [0.1, 0.01], "quantiles": [1.0, 2.0], "windows": 40}
    model = random_model(UNICYCLE, continuous=True)
    model = replace(model, info={"noise_quantiles": quantiles, "method": "integral"})
    fine = model.with_dt(0.01)
    # calibrated for noise that the other period does not have
    assert fine.info == {"method": "integral"} and "noise_quantiles" in model.info
    coarse_path = model.rollout(np.zeros(3), np.full((1, 2), 0.4))
    fine_path = fine.rollout(np.zeros(3), np.full((10, 2), 0.4))
    np.testing.assert_allclose(fine_path[-1], coarse_path[-1], atol=1e-6)
    assert fine.dt == 0.01 and fine.noise_model is None


@pytest.mark.parametrize(
    "model",
    [
        random_model(UNICYCLE, continuous=False),
        random_model(DICTIONARIES["history"], continuous=True),
    ],
)
def test_a_model_that_cannot_change_its_period_says_so(model: kl.KoopmanModel) -> None:
    with pytest.raises(kl.ModelError, match="fit the log again"):
        model.with_dt(0.05)
    with pytest.raises(kl.ModelError, match="dt"):
        random_model(UNICYCLE, continuous=True).with_dt(-1.0)
