"""A port, and things that are closed after a test."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest
from free_port import free_port


@pytest.fixture
def tcp() -> str:
    return f"tcp:127.0.0.1:{free_port()}"


@pytest.fixture
def closing() -> Iterator[Callable[..., None]]:
    """Closes what it is given at the end."""
    things: list[object] = []
    yield things.append
    for thing in reversed(things):
        thing.close()  # type: ignore[attr-defined]
