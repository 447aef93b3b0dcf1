"""Logs as npz archives: what is wrong is said with file, row and array."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused_logs import HEADER, refusal

import kmpc_lite as kl

pytestmark = pytest.mark.usefixtures("no_warnings")


def columns(**changed: Any) -> dict[str, Any]:
    """Arrays of a good npz log, some of them replaced."""
    time = 0.1 * np.arange(5)
    return {**{name: time for name in HEADER.split(",")}, **changed}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"x": np.zeros((5, 1))}, "one-dimensional arrays of one length"),
        ({"x": np.float64(1.0)}, "one-dimensional arrays of one length"),
        ({"v": np.array(list("abcde"))}, "array v: expected an array of real numbers"),
        ({"v": np.zeros(5, dtype=[("a", float)])}, "array v: expected an array of real numbers"),
        ({"t": np.array([0, 1, 2, 2, 4])}, "row 3, column t: time must grow"),
    ],
)
def test_arrays_that_make_no_log(tmp_path: Path, changed: dict[str, Any], words: str) -> None:
    np.savez(tmp_path / "run.npz", **columns())
    kl.Dataset.load(tmp_path / "run.npz")
    np.savez(tmp_path / "run.npz", **columns(**changed))
    text = refusal(tmp_path / "run.npz")
    assert "run.npz" in text and words in text, text


def test_a_missing_array_is_named(tmp_path: Path) -> None:
    kept = {name: values for name, values in columns().items() if name != "omega"}
    np.savez(tmp_path / "run.npz", **kept)
    assert "arrays: omega missing" in refusal(tmp_path / "run.npz")
    np.savez(tmp_path / "run.npz")
    assert "got nothing" in refusal(tmp_path / "run.npz")
