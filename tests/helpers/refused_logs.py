"""Logs as text, and what is said of those that are refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

import kmpc_lite as kl

HEADER = "t,x,y,theta,v,omega"
GOOD = [f"{0.1 * k:.1f},{k},2,0.5,0.25,0" for k in range(6)]


def write(path: Path, *lines: str, ends: str = "\n") -> Path:
    """A text file of these lines."""
    path.write_bytes("".join(line + ends for line in lines).encode())
    return path


def refusal(path: str | Path, **options: Any) -> str:
    """Text of the DataError that a log gets: one line that names the file."""
    with pytest.raises(kl.DataError) as caught:
        kl.Dataset.load(path, **options)
    text = str(caught.value)
    assert "\n" not in text and len(text) < 400 and text.isprintable()
    return text
