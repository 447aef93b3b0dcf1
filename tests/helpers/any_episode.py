"""Episodes whose values tell where they come from, and any others."""

from __future__ import annotations

import numpy as np

import kmpc_lite as kl

HEADER = "t,x,y,theta,v,omega"


def numbered(steps: int, number: int, dt: float = 0.1) -> kl.Episode:
    """An episode whose every value tells its episode (thousands) and row."""
    row = 1000.0 * number + np.arange(steps + 1)
    return kl.Episode(
        np.c_[row, row + 0.25, 0.001 * np.arange(steps + 1)], np.c_[row[:-1], -row[:-1]], dt
    )


def wandering(steps: int, dt: float, seed: int = 0) -> kl.Episode:
    """Any drive."""
    random = np.random.default_rng(seed)
    return kl.Episode(
        0.3 * np.cumsum(random.normal(size=(steps + 1, 3)), axis=0),
        random.normal(size=(steps, 2)),
        dt,
    )


def owner(data: kl.Dataset) -> list[int]:
    """Numbers of the episodes."""
    return [int(e.states[0, 0] // 1000) for e in data.episodes]
