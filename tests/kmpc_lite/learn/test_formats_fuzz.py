"""Whatever stands in a log: a dataset comes out, or a DataError of one line that names the file."""

from __future__ import annotations

import tempfile
import warnings
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

import kmpc_lite as kl

HEADER = "t,x,y,theta,v,omega\n"
ROWS = "".join(f"{0.1 * k:.1f},{k},2,0.5,1,0.25\n" for k in range(5))
NUMBERS = [
    "0",
    "0.1",
    "-2.5",
    "1e5",
    "nan",
    "-inf",
    "1e999",
    "1_0",
    "0x1F",
    "1d5",
    "1j",
    "\u0661",
    "True",
]
SIGNS = [
    ",",
    ",",
    "\n",
    "\n",
    "\r\n",
    "\r",
    '"',
    '""',
    " ",
    "\t",
    "#",
    ";",
    "-",
    ".",
    "\0",
    "\x1a",
    "\ufeff",
    "\u2028",
    "\x85",
    "\x0c",
    "\x1c",
    "\u00e9",
]
tokens = st.sampled_from(NUMBERS + SIGNS)


def check(content: bytes, ending: str) -> None:
    """Load it with every warning an error."""
    with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("error")
        path = Path(folder) / f"run{ending}"
        path.write_bytes(content)
        try:
            data = kl.Dataset.load(path, dt=0.1)
        except kl.DataError as error:
            text = str(error)
            assert path.name in text and text.isprintable() and len(text) < 400
        else:
            assert all(
                np.isfinite(e.states).all() and np.isfinite(e.inputs).all() for e in data.episodes
            )


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.lists(tokens, max_size=40))
def test_any_rows_under_a_good_header(words: list[str]) -> None:
    check((HEADER + "".join(words)).encode(), ".csv")


@settings(max_examples=300, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.integers(0, len(HEADER + ROWS)), st.integers(0, 3), tokens),
        min_size=1,
        max_size=3,
    )
)
def test_a_good_log_with_something_put_in_or_taken_out(changes: list[tuple[int, int, str]]) -> None:
    text = HEADER + ROWS
    for place, removed, word in changes:
        text = text[:place] + word + text[place + removed :]
    check(text.encode(), ".csv")


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.binary(max_size=300), st.sampled_from([".csv", ".npz"]), st.booleans())
def test_any_bytes(content: bytes, ending: str, headed: bool) -> None:
    check((HEADER.encode() if headed else b"") + content, ending)
