"""Waiting for what another thread or process does."""

from __future__ import annotations

import time
from collections.abc import Callable

LOOKS_EVERY = 0.001  # [s]


def until(condition: Callable[[], object], seconds: float = 20.0) -> bool:
    """Wait for a condition; whether it came."""
    end = time.monotonic() + seconds
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(LOOKS_EVERY)
    return True
