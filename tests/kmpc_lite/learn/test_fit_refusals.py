"""Data that cannot determine a model, and what no fit can use."""

from typing import Any

import pytest
from paper_drives import TRIG, UNICYCLE, drives

import kmpc_lite as kl


@pytest.mark.parametrize("ridge", [-1e-9, float("nan"), float("inf")])
def test_an_impossible_ridge_is_refused(ridge: float) -> None:
    with pytest.raises(kl.DataError, match="ridge"):
        kl.fit(drives(), ridge=ridge)


def changed(change: Any) -> kl.Dataset:
    """Drives whose states and inputs went through a function."""
    return kl.Dataset([kl.Episode(*change(e.states, e.inputs), e.dt) for e in drives().episodes])


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("method", ["integral", "edmdc"])
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x, u: (x, u * [0, 1] + [0.3, 0]), r"column v is constant \(0.3\)"),
        (lambda x, u: (x, u * [1, 0] - [0, 0.7]), r"column omega is constant \(-0.7\)"),
        (lambda x, u: (x, u * [1, 0]), r"column omega is constant \(0\)"),
        (lambda x, u: (x, 0 * u), r"column v is constant \(0\)"),
        (lambda x, u: (x, u @ [[1, 2], [0, 0]]), "does not excite the model: rank 12"),
        (lambda x, u: (0 * x, u), "does not excite the model: rank 3"),
        (lambda x, u: (x * [1, 1, 0], u), "does not excite the model"),
        (lambda x, u: (1e200 * x, u), "too large"),
        (lambda x, u: (x, 1e200 * u), "too large"),
    ],
)
def test_what_does_not_determine_a_model_is_reported(method: Any, change: Any, words: str) -> None:
    with pytest.raises(kl.DataError, match=words):
        kl.fit(changed(change), method=method, symmetric=False)


def test_too_few_samples() -> None:
    short = kl.Dataset(
        [kl.Episode(e.states[:5], e.inputs[:4], e.dt) for e in drives().episodes[:4]]
    )
    with pytest.raises(kl.DataError, match="too few samples: 16 steps for 18 unknowns"):
        kl.fit(short, symmetric=False)
    with pytest.raises(kl.DataError, match="too few samples: 0 steps with an input history of 4"):
        kl.fit(short, kl.InputHistoryDictionary(TRIG, lags=(0, 4)))
    with pytest.raises(kl.DataError, match="too few samples: 0 steps"):
        kl.Accumulator(UNICYCLE, 0.1).solve()


def test_what_no_fit_can_use() -> None:
    data = drives()
    with pytest.raises(
        kl.DataError, match=r"expected a Dataset, got str; Dataset.load\(path\) reads a log"
    ):
        kl.fit("run.csv")  # type: ignore[arg-type]
    with pytest.raises(
        kl.DataError, match=r"dictionary: expected one like UnicycleDictionary\(\), got 'trig'"
    ):
        kl.fit(data, "trig")  # type: ignore[arg-type]
    with pytest.raises(kl.DataError, match="expected 'integral' or 'edmdc', got 'magic'"):
        kl.fit(data, method="magic")  # type: ignore[arg-type]
    with pytest.raises(kl.DataError, match="needs x, y and theta in the span of the dictionary"):
        kl.fit(data, TRIG, method="edmdc")
    with pytest.raises(kl.DataError, match="dataset's dt is 0.1 s, the fit's 0.2 s"):
        kl.Accumulator(UNICYCLE, 0.2).add(data)
    for dt in (0.0, float("nan")):
        with pytest.raises(kl.DataError, match="dt"):
            kl.Accumulator(UNICYCLE, dt)
    paper = kl.fit(data, method="edmdc")
    for dictionary, method, midpoint in (
        (UNICYCLE, "integral", paper),
        (TRIG, "integral", kl.fit(data)),
        (UNICYCLE, "edmdc", kl.fit(data)),
    ):
        with pytest.raises(kl.DataError, match="midpoint"):
            kl.Accumulator(dictionary, 0.1, method, midpoint)  # type: ignore[arg-type]
