"""The bilinear model: prediction, rollout and linearisation agree.

Wrong shapes and matrices are refused.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.model.noise_model import NoiseModel

TRIG = kl.HermiteTrigDictionary(0)
UNICYCLE = kl.UnicycleDictionary()
DICTIONARIES = {
    "unicycle": UNICYCLE,
    "trig": TRIG,
    "hermite 2": kl.HermiteTrigDictionary(2),
    "history": kl.InputHistoryDictionary(UNICYCLE, lags=(0, 1, 3)),
    "delay and product": kl.InputHistoryDictionary(TRIG, lags=(2, 1), product=True),
    "present product": kl.InputHistoryDictionary(TRIG, lags=(0,), product=True),
}


def random_model(
    dictionary: kl.Dictionary, continuous: bool, integrator: str = "rk4", seed: int = 0
) -> kl.KoopmanModel:
    """A model with no structure to hide behind."""
    random = np.random.default_rng(seed)
    nz, nw = dictionary.size, dictionary.input_size
    rows = 3 if continuous else nz
    a, b, h = (random.normal(size=(rows, columns)) / (3 * nz) for columns in (nz, nw, nw * nz))
    c = np.eye(3) if continuous else random.normal(size=(3, nz))
    return kl.KoopmanModel(dictionary, 0.1, a, b, h, c, continuous, integrator=integrator)


KINDS = {"integral": (True, "rk4"), "midpoint": (True, "midpoint"), "edmdc": (False, "rk4")}
MODELS = [
    pytest.param(random_model(d, *k), id=f"{n}, {kind}")
    for n, d in DICTIONARIES.items()
    for kind, k in KINDS.items()
]
every_model = pytest.mark.parametrize("model", MODELS)


def points(
    model: kl.KoopmanModel, *lead: int, seed: int = 1
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States, commands and histories with any leading axes."""
    random = np.random.default_rng(seed)
    return (
        random.normal(size=(*lead, 3)),
        random.normal(size=(*lead, 2)),
        random.normal(size=(*lead, model.history, 2)),
    )


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
def test_a_rollout_without_history_starts_at_rest(model: kl.KoopmanModel) -> None:
    x, inputs = np.ones(3), np.full((5, 2), 0.2)
    np.testing.assert_array_equal(
        model.rollout(x, inputs), model.rollout(x, inputs, np.zeros((model.history, 2)))
    )
    np.testing.assert_array_equal(
        model.predict(x, inputs[0]), model.predict(x, inputs[0], np.zeros((model.history, 2)))
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
@pytest.mark.parametrize("lead", [(1,), (20,), (2, 3), (0,)])
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


@every_model
def test_leading_axes_broadcast(model: kl.KoopmanModel) -> None:
    x, u, past = points(model, 4)
    inputs = 0.1 * np.ones((5, 2))
    close = {"rtol": 1e-11, "atol": 1e-12}
    np.testing.assert_allclose(
        model.predict(x, u[0], past[0])[2], model.predict(x[2], u[0], past[0]), **close
    )
    np.testing.assert_allclose(
        model.predict(x[0], u, past[0])[2], model.predict(x[0], u[2], past[0]), **close
    )
    np.testing.assert_allclose(
        model.rollout(x, inputs, past[0])[2], model.rollout(x[2], inputs, past[0]), **close
    )
    np.testing.assert_allclose(model.rollout(x, inputs)[2], model.rollout(x[2], inputs), **close)
    np.testing.assert_allclose(
        model.rollout(x[0], np.stack([inputs, u[:1] + 0 * inputs]))[0],
        model.rollout(x[0], inputs),
        **close,
    )
    if model.history:
        np.testing.assert_allclose(
            model.predict(x[0], u[0], past)[2], model.predict(x[0], u[0], past[2]), **close
        )
        np.testing.assert_allclose(
            model.rollout(x[0], inputs, past)[2], model.rollout(x[0], inputs, past[2]), **close
        )
        np.testing.assert_allclose(
            model.linearize(x[0], u, past[0]).B_past[2],
            model.linearize(x[0], u[2], past[0]).B_past,
            **close,
        )


def test_lists_and_whole_numbers_are_welcome() -> None:
    model = random_model(UNICYCLE, continuous=False)
    np.testing.assert_array_equal(
        model.predict([1, 2, 3], [1, 0]),
        model.predict(np.array([1.0, 2.0, 3.0]), np.array([1.0, 0.0])),
    )


@pytest.mark.parametrize(
    ("x", "u", "history"),
    [
        (np.zeros(4), np.zeros(2), None),
        (np.zeros(3), np.zeros(3), None),
        (0.0, np.zeros(2), None),
        (np.zeros((5, 3)), np.zeros((4, 2)), None),
        (np.zeros(3), np.zeros(2), np.zeros((2, 2))),
        (np.zeros(3), np.zeros(2), np.zeros((3, 3))),
        (np.zeros(3), np.zeros(2), np.zeros(2)),
        (np.zeros((5, 3)), np.zeros((5, 2)), np.zeros((4, 3, 2))),
        ("here", np.zeros(2), None),
    ],
)
def test_wrong_shapes_are_value_errors(x: Any, u: Any, history: Any) -> None:
    model = random_model(DICTIONARIES["history"], continuous=True)
    for method in (model.predict, model.linearize):
        with pytest.raises(ValueError):
            method(x, u, history)


@pytest.mark.parametrize(
    ("x0", "inputs", "history"),
    [
        (np.zeros(3), np.zeros(2), None),
        (np.zeros(3), np.zeros((5, 3)), None),
        (np.zeros(2), np.zeros((5, 2)), None),
        (np.zeros((4, 3)), np.zeros((3, 5, 2)), None),
        (np.zeros(3), np.zeros((5, 2)), np.zeros((1, 2))),
    ],
)
def test_wrong_shapes_of_a_rollout_are_value_errors(x0: Any, inputs: Any, history: Any) -> None:
    for model in (
        random_model(UNICYCLE, continuous=True),
        random_model(DICTIONARIES["history"], continuous=True),
    ):
        if history is None or model.history:
            with pytest.raises(ValueError, match="expected|shape"):
                model.rollout(x0, inputs, history)


def matrices(**changed: Any) -> dict[str, Any]:
    """Arguments of a good continuous model of the paper's dictionary, some of them replaced."""
    good = {
        "A": np.zeros((3, 6)),
        "B": np.zeros((3, 2)),
        "H": np.zeros((3, 12)),
        "C": np.eye(3),
        "dt": 0.1,
    }
    return {**good, "dictionary": UNICYCLE, "continuous": True, **changed}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"A": np.zeros((3, 5))}, "A: expected shape"),
        ({"A": np.zeros((4, 6))}, "B: expected shape"),
        ({"A": 1.0}, "A: expected shape"),
        ({"A": None}, "A"),
        ({"A": "matrix"}, "A: expected an array of real numbers"),
        ({"A": np.zeros((3, 6), complex)}, "A: expected an array of real numbers"),
        ({"A": [[1.0], [1.0, 2.0]]}, "A: expected an array of real numbers"),
        ({"B": np.full((3, 2), np.nan)}, "B holds NaN"),
        ({"H": np.full((3, 12), np.inf)}, "H holds NaN or infinity"),
        ({"C": np.eye(2)}, "C: expected shape"),
        ({"dictionary": TRIG}, "A: expected shape"),
        ({"dt": 0.0}, "dt"),
        ({"dt": -0.1}, "dt"),
        ({"dt": float("nan")}, "dt"),
        ({"dt": "fast"}, "dt"),
        ({"integrator": "euler"}, "integrator"),
        ({"noise_model": NoiseModel(np.zeros((3, 3)))}, "noise"),
        ({"noise_model": NoiseModel(np.full((3, 3, 3), np.nan))}, "noise"),
        ({"noise_model": NoiseModel(-np.ones((3, 3, 3)))}, "semidefinite"),
        ({"noise_model": NoiseModel(np.triu(np.ones((3, 3, 3))))}, "symmetric"),
    ],
)
def test_matrices_that_do_not_fit_are_model_errors(changed: dict[str, Any], words: str) -> None:
    kl.KoopmanModel(**matrices())
    with pytest.raises(kl.ModelError, match=words):
        kl.KoopmanModel(**matrices(**changed))


def test_the_nominal_unicycle_is_the_plant_without_slip() -> None:
    random = np.random.default_rng(7)
    x, u = random.uniform(-3.0, 3.0, (100, 3)), random.uniform(-1.0, 1.0, (100, 2))
    model, plant = kl.nominal_unicycle(0.1), kl.DifferentialDrive(slip=0.0)
    np.testing.assert_allclose(model.predict(x, u), plant.step(x, u, 0.1), rtol=0, atol=1e-8)


def test_the_nominal_unicycle_drives_circles() -> None:
    v, omega, dt = 0.5, 0.7, 0.1
    path = kl.nominal_unicycle(dt).rollout([0.0, 0.0, 0.0], np.tile([v, omega], (80, 1)))
    angle = omega * dt * np.arange(81)
    exact = np.c_[v / omega * np.sin(angle), v / omega * (1 - np.cos(angle)), angle]
    np.testing.assert_allclose(path, exact, atol=1e-7)


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
    model = random_model(UNICYCLE, continuous=True)
    fine = model.with_dt(0.01)
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


@pytest.mark.parametrize("integrator", ["rk4", "midpoint"])
@pytest.mark.parametrize("name", sorted(DICTIONARIES))
def test_closed_form_of_a_symmetric_model_is_its_bilinear_form(name: str, integrator: str) -> None:
    from kmpc_lite.learn.symmetry import symmetric_generator

    dictionary, random = DICTIONARIES[name], np.random.default_rng(5)
    nz, nw = dictionary.size, dictionary.input_size
    h = symmetric_generator(dictionary, *random.normal(size=(3, nw)))
    pull = np.zeros((3, nw))
    pull[2] = random.normal(size=nw)
    parts = np.zeros((3, nz)), pull, h, np.eye(3)
    closed = kl.KoopmanModel(dictionary, 0.2, *parts, continuous=True, integrator=integrator)
    assert closed.closed_form is not None
    free = replace(closed)
    object.__setattr__(free, "closed_form", None)
    x, u = random.normal(size=(2, 7, 3)), random.normal(size=(2, 7, 2))
    past = random.normal(size=(2, 7, dictionary.history, 2))
    assert_close = partial(np.testing.assert_allclose, rtol=1e-12, atol=1e-13)
    assert_close(closed.predict(x, u, past), free.predict(x, u, past))
    assert_close(closed.predict(x[0, 0], u[0, 0], past[0, 0]), free.predict(x, u, past)[0, 0])
    for mine, theirs in zip(closed.linearize(x, u, past), free.linearize(x, u, past), strict=True):
        assert_close(mine, theirs)
    assert_close(closed.rollout(x[:, 0], u, past[:, 0]), free.rollout(x[:, 0], u, past[:, 0]))
    assert_close(closed.rollout(x[0, 0], u[0]), free.rollout(x[0, 0], u[0]))


@pytest.mark.parametrize("place", [("A", 0, 3), ("B", 1, 0), ("H", 0, 4), ("H", 1, 2), ("H", 2, 1)])
def test_a_model_that_is_not_symmetric_has_no_closed_form(place: tuple[str, int, int]) -> None:
    name, row, column = place
    symmetric = kl.nominal_unicycle(0.1)
    matrix = getattr(symmetric, name).copy()
    matrix[row, column] += 1e-6
    other = replace(symmetric, **{name: matrix})
    assert other.closed_form is None
    assert not np.array_equal(
        other.predict([0.4, 0.2, 0.9], [0.5, 0.3]), symmetric.predict([0.4, 0.2, 0.9], [0.5, 0.3])
    )


def test_a_dictionary_that_lifts_otherwise_than_its_names_say_has_no_closed_form() -> None:
    class Doubled(kl.UnicycleDictionary):
        def lift(self, x: Any) -> Any:
            return super().lift(np.asarray(x) * (1.0, 1.0, 2.0))

    assert replace(kl.nominal_unicycle(0.1), dictionary=Doubled()).closed_form is None


def test_displacement_along_measured_headings_is_the_generator_integrated_by_simpson() -> None:
    random = np.random.default_rng(8)
    model = replace(kl.nominal_unicycle(0.2), B=np.array([[0.0, 0.0], [0.0, 0.0], [0.3, -0.2]]))
    assert model.closed_form is not None
    heading, turned, w = 0.7, -0.9, random.normal(size=2)
    x, y, turn, ahead = model.closed_form.displacement(heading, turned, w)
    poses = np.zeros((3, 3))
    poses[:, 2] = heading + turned * np.array((0.0, 0.5, 1.0))
    z = model.dictionary.lift(poses)
    blocks = model.H.reshape(3, 2, -1)
    rates = np.einsum("ran,a,tn->tr", blocks, w, z) + model.B @ w
    expected = 0.2 * np.array((1.0, 4.0, 1.0)) @ rates / 6.0
    np.testing.assert_allclose((x, y, turn), expected, rtol=1e-12)
    assert ahead == pytest.approx(0.2 * w[0])


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_stays_so_and_raises_nothing(bad: float) -> None:
    model = kl.nominal_unicycle(0.1)
    with np.errstate(invalid="ignore"):
        assert np.isnan(model.predict([0.0, 0.0, bad], [0.5, 0.1])[0])
        assert np.isnan(model.predict([0.0, 0.0, 0.0], [0.5, bad])[0])
        assert np.isnan(model.rollout([0.0, 0.0, bad], [[0.5, 0.1]])[1, 0])
        assert np.isnan(model.linearize([0.0, 0.0, bad], [0.5, 0.1]).value[0])
