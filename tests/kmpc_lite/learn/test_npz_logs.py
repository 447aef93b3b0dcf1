"""Logs as npz archives: what is wrong is said with file, row and array."""

from __future__ import annotations

import io
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from refused_logs import HEADER, refusal

import kmpc_lite as kl

pytestmark = pytest.mark.usefixtures("no_warnings")


def test_arrays_of_any_real_type_and_others_not_looked_at(tmp_path: Path) -> None:
    columns = {
        name: np.arange(4, dtype=kind)
        for name, kind in zip(HEADER.split(","), ["f4", "i8", "u1", "f8", "i2", "f2"], strict=True)
    }
    np.savez(
        tmp_path / "run.npz",
        **columns,
        note=np.array(["a", "b"]),
        pickled=np.array([object], dtype=object),
    )
    data = kl.Dataset.load(tmp_path / "run.npz")
    np.testing.assert_array_equal(data.episodes[0].states[:, 0], np.arange(4.0))


def columns(**changed: Any) -> dict[str, Any]:
    """Arrays of a good npz log, some of them replaced."""
    time = 0.1 * np.arange(5)
    return {**{name: time for name in HEADER.split(",")}, **changed}


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"x": np.zeros((5, 1))}, "one-dimensional arrays of one length"),
        ({name: np.zeros((5, 2)) for name in HEADER.split(",")}, "one-dimensional arrays"),
        ({"x": np.zeros(4)}, "one-dimensional arrays of one length"),
        ({"x": np.float64(1.0)}, "one-dimensional arrays of one length"),
        ({name: np.float64(1.0) for name in HEADER.split(",")}, "one-dimensional arrays"),
        ({name: np.zeros(0) for name in HEADER.split(",")}, "0 row(s)"),
        ({name: np.zeros(1) for name in HEADER.split(",")}, "1 row(s)"),
        ({"v": np.array(list("abcde"))}, "array v: expected an array of real numbers"),
        ({"v": np.arange(5) + 1j}, "array v: expected an array of real numbers"),
        ({"t": np.arange(5).astype("datetime64[s]")}, "array t: expected an array of real numbers"),
        ({"v": np.zeros(5, dtype=[("a", float)])}, "array v: expected an array of real numbers"),
        ({"v": np.array([0, 1, None, 3, 4], dtype=object)}, "Object arrays cannot be loaded"),
        (
            {"v": np.array([0, 1, np.nan, np.nan, np.nan])},
            "row 2, column v: expected a finite number in m/s, got nan",
        ),
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


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_damaged_archives(tmp_path: Path, save: Any) -> None:
    path, out = tmp_path / "run.npz", io.BytesIO()
    save(out, **columns())
    whole = out.getvalue()
    path.write_bytes(whole)
    good = kl.Dataset.load(path)
    for length in range(0, len(whole), 41):
        path.write_bytes(whole[:length])
        assert "run.npz: not an npz log, or damaged" in refusal(path)
    random, refused = np.random.default_rng(0), 0
    for position in range(0, len(whole), 7):
        damaged = bytearray(whole)
        damaged[position] ^= int(random.integers(1, 256))
        path.write_bytes(damaged)
        try:
            data = kl.Dataset.load(path)
        except kl.DataError:
            refused += 1
        else:  # a flip in what a zip file says of dates and permissions
            np.testing.assert_array_equal(data.episodes[0].states, good.episodes[0].states)
    assert refused > 0.5 * len(whole) / 7


@pytest.mark.parametrize(
    "content",
    [
        b"",
        b"t,x,y\n",
        pickle.dumps({"t": [0, 1]}),
        b"\x93NUMPY",
        np.random.default_rng(0).bytes(3000),
    ],
)
def test_files_that_are_no_archive(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "run.npz").write_bytes(content)
    text = refusal(tmp_path / "run.npz")
    assert "not an npz log, or damaged" in text and "unsafely" not in text


def test_an_array_under_the_name_of_an_archive(tmp_path: Path) -> None:
    with open(tmp_path / "run.npz", "wb") as file:
        np.save(file, np.zeros(3))
    assert "not an npz log, or damaged" in refusal(tmp_path / "run.npz")
