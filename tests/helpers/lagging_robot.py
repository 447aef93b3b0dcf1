"""A robot that obeys late, its plans, and how it brakes."""

from __future__ import annotations

import numpy as np

import kmpc_lite as kl
from kmpc_lite.control.nmpc.qp import Trajectory

PROBLEM = kl.NavigationProblem()


def lagging() -> kl.KoopmanModel:
    """A robot whose wheels do what was asked of them four periods ago."""
    trig = kl.nominal_unicycle(0.1)
    delayed = kl.InputHistoryDictionary(trig.dictionary, lags=(0, 1, 2, 3, 4))
    h = np.zeros((3, 10, trig.dictionary.size))
    h[:, 8:] = trig.H.reshape(3, 2, -1)
    return kl.KoopmanModel(
        delayed, 0.1, trig.A, np.zeros((3, 10)), h.reshape(3, -1), np.eye(3), continuous=True
    )


def straight(
    model: kl.KoopmanModel, past: np.ndarray, v: float = 0.6, omega: float = 0.0
) -> Trajectory:
    inputs = np.tile((v, omega), (20, 1))
    return Trajectory(model.rollout(np.zeros(3), inputs, past), inputs, np.zeros(1))
