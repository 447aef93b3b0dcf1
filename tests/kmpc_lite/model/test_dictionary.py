"""Dictionaries: Jacobians against finite differences, batches, names, configurations."""

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


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: kl.HermiteTrigDictionary(1.5), "integers >= 0"),
        (lambda: kl.HermiteTrigDictionary(1, harmonics=-2), "integers >= 0"),
        (lambda: kl.HermiteTrigDictionary(60), "coordinates"),
        (lambda: kl.InputHistoryDictionary(TRIG, lags=()), "lags"),
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
        {"kind": "unicycle", "order": 1},
        {"kind": "hermite_trig", "order": "two"},
        {"kind": "input_history"},
        {"kind": "input_history", "base": {"kind": "unicycle"}, "lags": ["a"], "product": False},
    ],
)
def test_a_wrong_configuration_is_a_model_error(config: object) -> None:
    with pytest.raises(kl.ModelError, match="dictionary|HermiteTrig|InputHistory"):
        dictionary_from_config(config)  # type: ignore[arg-type]
