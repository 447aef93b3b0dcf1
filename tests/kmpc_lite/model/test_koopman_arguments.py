"""Wrong shapes and matrices of a model are refused."""

from typing import Any

import numpy as np
import pytest
from any_model import DICTIONARIES, TRIG, UNICYCLE, random_model

import kmpc_lite as kl
from kmpc_lite.model.noise_model import NoiseModel


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
        (0.0, np.zeros(2), None),
        (np.zeros(3), np.zeros(2), np.zeros((2, 2))),
        (np.zeros(3), np.zeros(2), np.zeros(2)),
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
        (np.zeros(2), np.zeros((5, 2)), None),
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
        ({"dictionary": TRIG}, "A: expected shape"),
        ({"dt": "fast"}, "dt"),
        ({"noise_model": NoiseModel(-np.ones((3, 3, 3)))}, "semidefinite"),
        ({"noise_model": NoiseModel(np.triu(np.ones((3, 3, 3))))}, "symmetric"),
    ],
)
def test_matrices_that_do_not_fit_are_model_errors(changed: dict[str, Any], words: str) -> None:
    kl.KoopmanModel(**matrices())
    with pytest.raises(kl.ModelError, match=words):
        kl.KoopmanModel(**matrices(**changed))
