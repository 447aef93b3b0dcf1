"""Models that studies drive with, learned as the paper learns."""

from __future__ import annotations

from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel

DT = 0.1
"""Sampling period of all studies [s]."""
EPISODES, STEPS = 1000, 1000
"""Drives that the paper learns from, and periods of each."""
TRAINING_SEED = 1_000
"""Of training data."""


def train(
    slip: float, method: Method, episodes: int = EPISODES, steps: int = STEPS
) -> KoopmanModel:
    """Learn as the paper does, at one slip; quantiles for margins come from drives of their own."""
    plant = DifferentialDrive(slip, seed=TRAINING_SEED)
    model = fit(generate_dataset(plant, episodes, steps, DT, seed=TRAINING_SEED + 1), method=method)
    if method == "edmdc":
        return model
    held = generate_dataset(
        DifferentialDrive(slip, seed=TRAINING_SEED + 2),
        max(episodes // 5, 10),
        max(steps // 5, 100),
        DT,
        seed=TRAINING_SEED + 3,
    )
    return with_quantiles(model, held)
