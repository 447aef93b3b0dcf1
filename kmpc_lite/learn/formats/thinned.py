"""A stream that takes bounded memory, however long it is."""

from __future__ import annotations

from array import array

import numpy as np

from kmpc_lite.types import Array

MOST_SAMPLES = 1_000_000
"""Samples that are kept of one stream: 40 MB of poses, 14 hours at 20 Hz."""


class Thinned:
    """Samples at least `spacing` apart; where they become too many, every other one is left out.

    Parameters
    ----------
    width : int
        Values of a sample.
    spacing : float
        Least time between two samples that are kept [s].
    most : int
        Samples that are kept.
    """

    def __init__(self, width: int, spacing: float, most: int = MOST_SAMPLES) -> None:
        self._width, self._spacing, self._most = width, spacing, most
        self._rows = array("d")
        self._last: float | None = None
        self.seen = 0
        """Number of samples that have come."""

    def wants(self, time: float) -> bool:
        """Count a sample at a time [s]; whether it is to be kept: one that runs back always is."""
        self.seen += 1
        last = self._last
        return last is None or time < last or time - last >= self._spacing * (1.0 - 1e-6)

    def add(self, time: float, *values: float) -> None:
        """Keep a sample."""
        self._last = time
        self._rows.append(time)
        self._rows.extend(values)
        if len(self._rows) >= self._most * (1 + self._width):
            kept = self.rows()[::2]
            seconds = float(kept[-1, 0] - kept[0, 0])
            self._rows = array("d", np.ascontiguousarray(kept).tobytes())
            self._spacing = max(2.0 * self._spacing, seconds / self._most)

    def rows(self) -> Array:
        """Time and values, (n, 1 + width)."""
        return np.array(self._rows, dtype=float).reshape(-1, 1 + self._width)
