"""Filtered commands and slip terms: exact derivatives, silence at rest, files that keep them."""

from pathlib import Path

import numpy as np
import pytest

import kmpc_lite as kl
from kmpc_lite.model.dictionary.response import ResponseDictionary
from kmpc_lite.model.dictionary.terms import OMNI_TERMS, TERMS

TRIG = kl.HermiteTrigDictionary(0)
LATE = ResponseDictionary(TRIG, (0.2, 0.5, 0.3), (0.6, 0.4), TERMS, (0.1, 0.2), (1.5, 2.0))


OMNI = ResponseDictionary(
    kl.HermiteTrigDictionary(0, commands=3),
    *((0.2, 0.5, 0.3), (0.6, 0.4), OMNI_TERMS, (0.1, 0.1, 0.2), (1.5, 1.2, 2.0)),
)


def some(count: int = 40, commands: int = 2) -> tuple[np.ndarray, np.ndarray]:
    """Commands inside and outside the limits, with a history."""
    random = np.random.default_rng(0)
    u = 1.5 * random.normal(size=(count, commands))
    return u, 1.5 * random.normal(size=(count, 2, commands))


@pytest.mark.parametrize("late", [LATE, OMNI], ids=["two speeds", "omni"])
def test_the_derivative_is_that_of_the_inputs(late: ResponseDictionary) -> None:
    u, past = some(commands=late.commands)
    jacobian, step = late.inputs_jacobian(u, past), 1e-6
    assert jacobian is not None and jacobian.shape == (40, len(late.terms), 3, late.commands)
    for age in range(3):
        for column in range(late.commands):
            ends = []
            for sign in (1, -1):
                now, before = u.copy(), past.copy()
                (now if age == 0 else before[:, -age])[:, column] += sign * step
                ends.append(late.inputs(now, before))
            found = (ends[0] - ends[1]) / (2 * step)
            if "v*|omega|" in late.terms and column == 1:
                # what turning costs is predicted, and not steered with
                found[:, late.terms.index("v*|omega|")] = 0.0
            np.testing.assert_allclose(jacobian[:, :, age, column], found, atol=1e-7)


@pytest.mark.parametrize("late", [LATE, OMNI], ids=["two speeds", "omni"])
def test_at_rest_every_term_and_the_slope_of_every_slip_term_is_zero(
    late: ResponseDictionary,
) -> None:
    zero, none = np.zeros(late.commands), np.zeros((2, late.commands))
    assert not late.inputs(zero, none).any()
    slopes = late.inputs_jacobian(zero, none)
    assert slopes is not None and not slopes[late.commands :].any()


def test_a_model_with_it_linearises_and_comes_back_from_its_file(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    h = random.normal(size=(3, 33))
    zeros = np.zeros((3, 3)), np.zeros((3, 11))
    model = kl.KoopmanModel(LATE, 0.1, *zeros, h, np.eye(3), continuous=True)
    model.save(tmp_path / "late.npz")
    again = kl.KoopmanModel.load(tmp_path / "late.npz")
    u, past = some()
    x = random.normal(size=(40, 3))
    np.testing.assert_array_equal(again.predict(x, u, past), model.predict(x, u, past))
    lin, step = model.linearize(x, u, past), 1e-6
    assert lin.B_past.shape == (40, 2, 3, 2)
    for column in range(2):
        before = past.copy()
        before[:, -2, column] += step
        slope = (model.predict(x, u, before) - model.predict(x, u, past)) / step
        np.testing.assert_allclose(lin.B_past[:, 1, :, column], slope, atol=1e-4)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"speed": ()}, "speed: expected 1 to"),
        ({"terms": ("v", "v")}, "terms must be different ones"),
        ({"terms": ("speed",)}, "terms must be different ones"),
        ({"smoothing": (0.0, 1.0)}, "smoothing: expected 2 numbers > 0"),
        ({"limits": (1.0,)}, "limits: expected 2 numbers > 0"),
        ({"base": LATE}, "must not have an input history"),
    ],
)
def test_what_it_cannot_be_is_refused(change: dict[str, object], words: str) -> None:
    with pytest.raises(kl.ModelError, match=words):
        ResponseDictionary(**{"base": TRIG, **change})  # type: ignore[arg-type]
