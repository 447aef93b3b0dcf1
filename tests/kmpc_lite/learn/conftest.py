"""What tests of learning share."""

from __future__ import annotations

import warnings
from collections.abc import Iterator

import pytest


@pytest.fixture
def no_warnings() -> Iterator[None]:
    """A library prints nothing: whatever warns fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield
