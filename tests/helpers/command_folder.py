"""What lies in a folder in which kmpc is run, and what is found there afterwards."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest

NEEDS_PICTURES = pytest.mark.skipif(
    importlib.util.find_spec("matplotlib") is None, reason="needs the extra plot"
)
SHORT = """\
[map]
bounds = [-2.0, -2.0, 2.0, 2.0]
circles = [[0.5, 0.6, 0.15]]
[robot]
start = [0.0, 0.0, 0.0]
goal = [0.7, 0.0, 0.0]
[run]
timeout = 4.0
"""


def files(folder: Path) -> list[str]:
    return sorted(str(p.relative_to(folder)) for p in folder.rglob("*"))
