"""Dictionaries: Jacobians against finite differences, batches, names, configurations."""

from __future__ import annotations

import json
from collections.abc import Callable

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.model.dictionary import dictionary_from_config, dictionary_to_config

TRIG = kl.HermiteTrigDictionary(0)
DICTIONARIES = [
    kl.UnicycleDictionary(),
    TRIG,
    kl.HermiteTrigDictionary(0, harmonics=0),
    kl.HermiteTrigDictionary(1),
    kl.HermiteTrigDictionary(2, harmonics=3),
    kl.HermiteTrigDictionary(4, harmonics=2),
    kl.InputHistoryDictionary(kl.UnicycleDictionary()),
    kl.InputHistoryDictionary(TRIG, lags=(1, 3), product=True),
    kl.InputHistoryDictionary(kl.HermiteTrigDictionary(2), lags=(2,)),
    kl.InputHistoryDictionary(kl.UnicycleDictionary(), lags=(0,), product=True),
]
ids = [json.dumps(dictionary_to_config(d)) for d in DICTIONARIES]
every_dictionary = pytest.mark.parametrize("dictionary", DICTIONARIES, ids=ids)


def central_difference(
    f: Callable[[np.ndarray], np.ndarray], at: np.ndarray, step: float = 1e-6
) -> np.ndarray:
    """Derivative of f at one point, its shape followed by that of the point."""
    columns = []
    for index in np.ndindex(at.shape):
        ahead, behind = at.copy(), at.copy()
        ahead[index] += step
        behind[index] -= step
        columns.append((f(ahead) - f(behind)) / (2 * step))
    return np.stack(columns, axis=-1).reshape(*columns[0].shape, *at.shape)


@every_dictionary
def test_jacobian_is_the_derivative_of_lift(dictionary: kl.Dictionary) -> None:
    for x in np.random.default_rng(1).uniform(-2.0, 2.0, (10, 3)):
        expected = central_difference(dictionary.lift, x)
        np.testing.assert_allclose(dictionary.jacobian(x), expected, rtol=1e-7, atol=1e-7)


@every_dictionary
def test_names_size_and_shapes_agree(dictionary: kl.Dictionary) -> None:
    x = np.zeros((4, 3))
    assert dictionary.size == len(dictionary.names) == len(set(dictionary.names))
    assert dictionary.lift(x).shape == (4, dictionary.size)
    assert dictionary.jacobian(x).shape == (4, dictionary.size, 3)
    assert dictionary.inputs(np.zeros((4, 2))).shape == (4, dictionary.input_size)


@every_dictionary
def test_a_batch_is_many_singles(dictionary: kl.Dictionary) -> None:
    random = np.random.default_rng(2)
    x, u = random.normal(size=(2, 5, 3)), random.normal(size=(2, 5, 2))
    past = random.normal(size=(2, 5, dictionary.history, 2))
    lifted, jacobian, inputs = (
        dictionary.lift(x),
        dictionary.jacobian(x),
        dictionary.inputs(u, past),
    )
    slopes = dictionary.inputs_jacobian(u, past)
    for i in np.ndindex(2, 5):
        np.testing.assert_array_equal(lifted[i], dictionary.lift(x[i]))
        np.testing.assert_array_equal(jacobian[i], dictionary.jacobian(x[i]))
        np.testing.assert_array_equal(inputs[i], dictionary.inputs(u[i], past[i]))
        if slopes is not None:
            np.testing.assert_array_equal(slopes[i], dictionary.inputs_jacobian(u[i], past[i]))


@every_dictionary
def test_the_name_of_each_coordinate_says_what_it_is(dictionary: kl.Dictionary) -> None:
    x, y, theta = pose = np.array([0.7, -1.3, 2.1])
    hermite = {
        f"He{n}": (lambda value, n=n: np.polynomial.hermite_e.hermeval(value, np.eye(n + 1)[n]))
        for n in range(dictionary.size)
        if n < 6
    }
    words = {"x": x, "y": y, "theta": theta, "cos": np.cos, "sin": np.sin, **hermite}
    bare = {"cos": np.cos(theta), "sin": np.sin(theta)} if "cos" in dictionary.names else {}
    expected = [
        eval(
            name.replace("2theta", "2*theta").replace("3theta", "3*theta"),
            {"__builtins__": {}},
            words | bare,
        )
        for name in dictionary.names
    ]
    np.testing.assert_allclose(dictionary.lift(pose), expected, rtol=1e-12, atol=1e-12)


@every_dictionary
def test_configuration_round_trip(dictionary: kl.Dictionary) -> None:
    twin = dictionary_from_config(json.loads(json.dumps(dictionary_to_config(dictionary))))
    x, u = np.random.default_rng(3).normal(size=(6, 3)), np.ones((6, 2))
    assert (
        type(twin) is type(dictionary)
        and twin.names == dictionary.names
        and twin.history == dictionary.history
    )
    np.testing.assert_array_equal(twin.lift(x), dictionary.lift(x))
    np.testing.assert_array_equal(twin.inputs(u), dictionary.inputs(u))


def test_order_one_holds_the_paper_dictionary() -> None:
    x = np.random.default_rng(4).uniform(-3.0, 3.0, (200, 3))
    rich, paper = kl.HermiteTrigDictionary(1).lift(x), kl.UnicycleDictionary().lift(x)
    weights, *_ = np.linalg.lstsq(rich, paper, rcond=None)
    np.testing.assert_allclose(rich @ weights, paper, atol=1e-12)


def test_the_paper_dictionary_is_what_the_paper_prints() -> None:
    expected = [1.0, 0.2, -0.4, 0.9, np.cos(0.9), np.sin(0.9)]
    np.testing.assert_array_equal(
        kl.UnicycleDictionary().lift(np.array([0.2, -0.4, 0.9])), expected
    )


HISTORIES = [((0,), False), ((0, 1, 2), False), ((2,), False), ((0, 2), True), ((3, 1), True)]


@pytest.mark.parametrize(("lags", "product"), HISTORIES)
def test_inputs_jacobian_is_the_derivative_of_inputs(lags: tuple[int, ...], product: bool) -> None:
    dictionary = kl.InputHistoryDictionary(TRIG, lags=lags, product=product)
    random = np.random.default_rng(5)
    u, past = random.normal(size=2), random.normal(size=(dictionary.history, 2))
    by_command = central_difference(lambda c: dictionary.inputs(c, past), u)
    by_past = (
        central_difference(lambda p: dictionary.inputs(u, p), past)
        if len(past)
        else np.empty((dictionary.input_size, 0, 2))
    )
    # the history is in order of time, the Jacobian newest first
    expected = np.concatenate([by_command[:, None], by_past[:, ::-1]], axis=1)
    np.testing.assert_allclose(dictionary.inputs_jacobian(u, past), expected, atol=1e-9)


@pytest.mark.parametrize(("lags", "product"), HISTORIES)
def test_inputs_are_the_commands_of_each_lag(lags: tuple[int, ...], product: bool) -> None:
    dictionary = kl.InputHistoryDictionary(TRIG, lags=lags, product=product)
    commands = np.random.default_rng(6).normal(size=(1 + dictionary.history, 2))
    delayed = [commands[-1 - lag] for lag in lags]
    expected = np.concatenate([*delayed, [c[0] * c[1] for c in delayed] if product else []])
    np.testing.assert_array_equal(dictionary.inputs(commands[-1], commands[:-1]), expected)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: kl.HermiteTrigDictionary(-1), "integers >= 0"),
        (lambda: kl.HermiteTrigDictionary(1.5), "integers >= 0"),  # type: ignore[arg-type]
        (lambda: kl.HermiteTrigDictionary(float("nan")), "integers >= 0"),  # type: ignore[arg-type]
        (lambda: kl.HermiteTrigDictionary(1, harmonics=-2), "integers >= 0"),
        (lambda: kl.HermiteTrigDictionary(60), "coordinates"),
        (lambda: kl.InputHistoryDictionary(TRIG, lags=()), "lags"),
        (lambda: kl.InputHistoryDictionary(TRIG, lags=(0, 0)), "lags"),
        (lambda: kl.InputHistoryDictionary(TRIG, lags=(-1,)), "lags"),
        (lambda: kl.InputHistoryDictionary(TRIG, lags=(0.5,)), "lags"),  # type: ignore[arg-type]
        (lambda: kl.InputHistoryDictionary(TRIG, lags=(10**9,)), "lags"),
        (lambda: kl.InputHistoryDictionary(kl.InputHistoryDictionary(TRIG), lags=(0,)), "history"),
    ],
)
def test_impossible_dictionaries_are_refused(make: Callable[[], kl.Dictionary], words: str) -> None:
    with pytest.raises(kl.ModelError, match=words):
        make()


@pytest.mark.parametrize(
    "config",
    [
        "unicycle",
        None,
        {},
        {"kind": "neural"},
        {"kind": "unicycle", "order": 1},
        {"kind": "hermite_trig", "order": "two"},
        {"kind": "hermite_trig", "order": float("inf")},
        {"kind": "hermite_trig", "degree": 2},
        {"kind": "input_history"},
        {"kind": "input_history", "base": "unicycle", "lags": [0], "product": False},
        {"kind": "input_history", "base": {"kind": "unicycle"}, "lags": 3, "product": False},
        {"kind": "input_history", "base": {"kind": "unicycle"}, "lags": ["a"], "product": False},
    ],
)
def test_a_wrong_configuration_is_a_model_error(config: object) -> None:
    with pytest.raises(kl.ModelError, match="dictionary|HermiteTrig|InputHistory"):
        dictionary_from_config(config)  # type: ignore[arg-type]
