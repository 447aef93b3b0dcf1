"""Both fits against what they must be.

The paper's pseudoinverse, and the system that made the data.
"""

from typing import Any

import numpy as np
import pytest
from paper_drives import TRIG, UNICYCLE, drives

import kmpc_lite as kl


@pytest.mark.parametrize(
    "dictionary",
    [
        UNICYCLE,
        kl.HermiteTrigDictionary(1),
        kl.InputHistoryDictionary(UNICYCLE, lags=(0, 2)),
        kl.InputHistoryDictionary(
            kl.HermiteTrigDictionary(1, harmonics=0), lags=(1,), product=True
        ),
    ],
)
def test_edmdc_is_the_pseudoinverse_of_the_paper(dictionary: kl.Dictionary) -> None:
    data = drives(slip=0.05)
    regressor, lifted, after, states = [], [], [], []
    for e in data.episodes:
        for k in range(dictionary.history, len(e)):
            z = dictionary.lift(e.states[k])
            w = dictionary.inputs(e.inputs[k], e.inputs[k - dictionary.history : k])
            regressor.append(
                np.concatenate([z, np.kron(w, z), w])
            )  # the stacking order [Z; U (x) Z; U] counts
            lifted.append(z)
            after.append(dictionary.lift(e.states[k + 1]))
            states.append(e.states[k])
    weights = np.array(after).T @ np.linalg.pinv(np.array(regressor).T)
    nz, nw = dictionary.size, dictionary.input_size
    model = kl.fit(data, dictionary, method="edmdc")
    np.testing.assert_allclose(model.A, weights[:, :nz], atol=1e-7)
    np.testing.assert_allclose(model.H, weights[:, nz : nz + nw * nz], atol=1e-7)
    np.testing.assert_allclose(model.B, weights[:, nz + nw * nz :], atol=1e-7)
    np.testing.assert_allclose(
        model.C, np.array(states).T @ np.linalg.pinv(np.array(lifted).T), atol=1e-7
    )
    assert not model.continuous
    assert (
        model.info["method"] == "edmdc"
        and model.info["samples"] == len(states)
        and model.info["features"] == nz + nw * nz + nw
    )
    assert (
        model.info["rank"]
        == np.linalg.matrix_rank(np.array(regressor))
        == model.info["features"] - nw
    )


def paper_rows(data: kl.Dataset) -> np.ndarray:
    """The regressor [z; u (x) z; u] of all steps, (n, 20)."""
    z = UNICYCLE.lift(np.concatenate([e.states[:-1] for e in data.episodes]))
    u = np.concatenate([e.inputs for e in data.episodes])
    return np.c_[z, u[:, :1] * z, u[:, 1:] * z, u]


def bilinear_truth(dictionary: kl.Dictionary, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (3, nz) and (3, nw nz) of a random bilinear system, slow enough to stay near."""
    random = np.random.default_rng(seed)
    nz, nw = dictionary.size, dictionary.input_size
    return 0.4 / np.sqrt(nz) * random.normal(size=(3, nz)), 0.4 / np.sqrt(nz) * random.normal(
        size=(3, nw * nz)
    )


@pytest.mark.parametrize("lags", [(0,), (0, 1), (2,)])
def test_edmdc_recovers_a_discrete_bilinear_system(lags: tuple[int, ...]) -> None:
    # [1, x, y, theta] is closed under it, so the lifted system is bilinear, exactly
    dictionary = kl.InputHistoryDictionary(kl.HermiteTrigDictionary(1, harmonics=0), lags=lags)
    a, h = bilinear_truth(dictionary, seed=1)
    random = np.random.default_rng(2)
    episodes = []
    for _ in range(20):
        states, inputs = [random.uniform(-1.0, 1.0, 3)], random.uniform(-1.0, 1.0, (40, 2))
        commands = np.vstack([np.zeros((dictionary.history, 2)), inputs])
        for k, u in enumerate(inputs):
            z = dictionary.lift(states[-1])
            states.append(
                a @ z + h @ np.kron(dictionary.inputs(u, commands[k : k + dictionary.history]), z)
            )
        episodes.append(kl.Episode(np.array(states), inputs, 0.1))
    model = kl.fit(kl.Dataset(episodes), dictionary, method="edmdc")
    # `w` stands in the regressor twice: only the sum of its two coefficients is determined
    constant = np.arange(dictionary.input_size) * dictionary.size + dictionary.names.index("1")
    both = (model.C @ model.H).copy()
    both[:, constant] += model.C @ model.B
    np.testing.assert_allclose(model.C @ model.A, a, atol=1e-9)
    np.testing.assert_allclose(both, h, atol=1e-9)
    e = episodes[0]
    length = dictionary.history
    np.testing.assert_allclose(
        model.rollout(e.states[length], e.inputs[length:], e.inputs[:length]),
        e.states[length:],
        atol=1e-8,
    )


def simulate(
    dictionary: kl.Dictionary,
    a: np.ndarray,
    h: np.ndarray,
    dt: float,
    episodes: int = 30,
    seconds: float = 4.0,
) -> kl.Dataset:
    """Drive a continuous bilinear system with held commands, finely integrated, all episodes at
    once.
    """
    random = np.random.default_rng(3)
    steps, fine = int(seconds / dt), 20
    states = np.empty((episodes, steps + 1, 3))
    states[:, 0] = random.uniform(-1.0, 1.0, (episodes, 3))
    inputs = random.uniform(-1.0, 1.0, (episodes, steps, 2))
    commands = np.concatenate([np.zeros((episodes, dictionary.history, 2)), inputs], axis=1)
    for k in range(steps):
        w = dictionary.inputs(inputs[:, k], commands[:, k : k + dictionary.history])

        def f(x: np.ndarray, w: np.ndarray = w) -> np.ndarray:
            z = dictionary.lift(x)
            return z @ a.T + (w[:, :, None] * z[:, None, :]).reshape(len(z), -1) @ h.T

        x, s = states[:, k], dt / fine
        for _ in range(fine):
            k1 = f(x)
            k2 = f(x + s / 2 * k1)
            k3 = f(x + s / 2 * k2)
            x = x + s / 6 * (k1 + 2 * k2 + 2 * k3 + f(x + s * k3))
        states[:, k + 1] = x
    return kl.Dataset([kl.Episode(x, u, dt) for x, u in zip(states, inputs, strict=True)])


@pytest.mark.parametrize(
    "dictionary",
    [
        TRIG,
        UNICYCLE,
        kl.HermiteTrigDictionary(1, harmonics=0),
        kl.InputHistoryDictionary(TRIG, lags=(0, 2), product=True),
    ],
)
def test_integral_recovers_a_continuous_bilinear_system(dictionary: kl.Dictionary) -> None:
    a, h = bilinear_truth(dictionary, seed=4)
    errors = []
    for dt in (0.1, 0.05):
        model = kl.fit(simulate(dictionary, a, h, dt), dictionary, symmetric=False)
        assert model.continuous and not model.B.any() and np.array_equal(model.C, np.eye(3))
        errors.append(max(np.abs(model.A - a).max(), np.abs(model.H - h).max()))
    # Simpson's rule with a Hermite midpoint: fourth order in dt, where a mean midpoint leaves
    # second order
    assert errors[1] < 3e-6 and errors[1] < errors[0] / 8


@pytest.mark.parametrize("method", ["integral", "edmdc"])
@pytest.mark.parametrize("distance", [100.0, 10_000.0])
def test_a_drive_far_from_the_origin_fits_as_well_or_says_so(method: Any, distance: float) -> None:
    near = drives()
    far = kl.Dataset(
        [kl.Episode(e.states + [distance, -distance, 0.0], e.inputs, e.dt) for e in near.episodes]
    )
    here, there = (
        kl.evaluate(kl.fit(data, method=method, symmetric=False), data).multi_step
        for data in (near, far)
    )
    np.testing.assert_allclose(there, here, rtol=0.01, atol=1e-6)
    lost = kl.Dataset(
        [kl.Episode(e.states + [5e6, -5e6, 0.0], e.inputs, e.dt) for e in near.episodes]
    )
    with pytest.raises(kl.DataError, match="not far from the origin"):
        kl.fit(lost, method=method, symmetric=False)
    assert kl.evaluate(kl.fit(lost, TRIG), lost).multi_step[0] < 1e-4


def test_a_ridge_is_that_of_the_scaled_least_squares() -> None:
    data, ridge = drives(slip=0.1), 0.01
    rows = paper_rows(data)
    targets = UNICYCLE.lift(np.concatenate([e.states[1:] for e in data.episodes]))
    scale = np.linalg.norm(rows, axis=0)
    expected = (
        np.linalg.solve(
            (rows / scale).T @ (rows / scale) + ridge * np.eye(20), (rows / scale).T @ targets
        )
        / scale[:, None]
    )
    model = kl.fit(data, method="edmdc", ridge=ridge)
    np.testing.assert_allclose(np.c_[model.A, model.H, model.B], expected.T, atol=1e-9)
