"""Users' troubles as small inputs, which lie beside the repository; tests skip without them."""

from pathlib import Path

import pytest

PLACES = [Path(__file__).parents[up] / "shared" / "cases" for up in (3, 4)]
"""Beside the repository, or beside the folder of its work trees."""


def case(name: str) -> Path:
    """Path of an input."""
    found = next((p for place in PLACES if (p := place / name).exists()), None)
    if found is None:
        pytest.skip(f"the input {name} is not here")
    return found
