"""A log as drives that studies split at random."""

from __future__ import annotations

from pathlib import Path

from kmpc_lite.learn.dataset import Dataset

FEWEST = 20
"""A log of fewer drives is cut into pieces: halves of a few drives say little."""
PIECE = 5.0
"""Length of such a piece [s]."""


def load_drives(log: Path, dt: float) -> Dataset:
    """Read a log at a period [s]; one that holds few long drives is cut into pieces of 5 s."""
    data = Dataset.load(log, dt=dt)
    return data if len(data) >= FEWEST else data.windows(PIECE)
