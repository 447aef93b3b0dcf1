"""Random driving as the paper trains with it, and two dictionaries."""

from __future__ import annotations

import kmpc_lab
import kmpc_lite as kl

UNICYCLE = kl.UnicycleDictionary()
TRIG = kl.HermiteTrigDictionary(0)


def drives(
    episodes: int = 20, steps: int = 60, dt: float = 0.1, slip: float = 0.0, seed: int = 0
) -> kl.Dataset:
    """Random driving, as the paper trains."""
    return kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(slip, seed), episodes=episodes, steps=steps, dt=dt, seed=seed
    )
