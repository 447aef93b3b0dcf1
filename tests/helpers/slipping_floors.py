"""Drives on floors that slip, and what a model adapted there gets wrong."""

import numpy as np

from kmpc_lab import DifferentialDrive, generate_dataset
from kmpc_lab.sim.plants.lag import LaggingDrive, drive_log
from kmpc_lite import KoopmanModel, fit
from kmpc_lite.learn.evaluation import evaluate
from kmpc_lite.model.dictionary import HermiteTrigDictionary

DT, U_MAX = 0.1, (0.6, 0.785)


def learned(slip=0.0, turn_gain=1.0, seed=5):
    plant = DifferentialDrive(slip, seed=seed, turn_gain=turn_gain)
    return fit(generate_dataset(plant, episodes=100, steps=300, dt=DT, seed=seed + 1))


MODELS: dict[tuple[float, float], KoopmanModel] = {}


def model_of(slip, turn_gain=1.0):
    key = slip, turn_gain
    if key not in MODELS:
        MODELS[key] = learned(slip, turn_gain)
    return MODELS[key]


def go(adaptation, plant, steps, seed, noise=(0.0, 0.0, 0.0), commands=None, hold=8):
    """Drive about with commands held for `hold` periods, within the area that was learned.

    The models given.
    """
    random = np.random.default_rng(seed)
    u = (
        np.repeat(random.uniform(-1, 1, (steps // hold + 1, 2)) * U_MAX, hold, axis=0)
        if commands is None
        else commands
    )
    given, x = [], random.uniform(-1, 1, 3)
    seen = x + random.normal(size=3) * noise
    for k in range(steps):
        x = plant.step(x, u[k], DT)
        after = x + random.normal(size=3) * noise
        model = adaptation.update(seen, u[k], after)
        if model is not None:
            given.append(model)
        seen = after
        if k % 60 == 59:
            x = random.uniform(-1, 1, 3)
            seen = x + random.normal(size=3) * noise
    return given


def errors(model, slip, turn_gain, seed=77):
    """Longitudinal, lateral, heading RMS after one step and after 1 s, on fresh drives."""
    plant = DifferentialDrive(slip, seed=seed, turn_gain=turn_gain)
    report = evaluate(
        model,
        generate_dataset(plant, episodes=60, steps=60, dt=DT, seed=seed + 1, u_max=U_MAX),
        1.0,
        stride=5,
    )
    return np.array(report.one_step + report.multi_step)


NOISY = (0.005, 0.005, 0.02)


def noisy_model(slip=0.0):
    """Learned from a log whose poses were noisy too."""
    log = drive_log(
        LaggingDrive(slip=slip, seed=5), episodes=60, steps=300, seed=6, pose_noise=NOISY
    )
    return fit(log, HermiteTrigDictionary(order=0))
