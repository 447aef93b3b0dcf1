"""Models that the tests of the controller share; each is made once."""

from __future__ import annotations

import numpy as np
import pytest

import kmpc_lab
import kmpc_lite as kl

DT = 0.1


@pytest.fixture(scope="session")
def nominal() -> kl.KoopmanModel:
    return kl.nominal_unicycle(DT)


@pytest.fixture(scope="session")
def slipping_data() -> kl.Dataset:
    return kmpc_lab.generate_dataset(
        kmpc_lab.DifferentialDrive(0.05, seed=1), episodes=40, steps=60, dt=DT, seed=2
    )


@pytest.fixture(scope="session")
def learned(slipping_data: kl.Dataset) -> kl.KoopmanModel:
    """Integral fit of a slipping robot."""
    return kl.fit(slipping_data)


@pytest.fixture(scope="session")
def learned_edmdc(slipping_data: kl.Dataset) -> kl.KoopmanModel:
    """The paper's fit of a slipping robot."""
    return kl.fit(slipping_data, method="edmdc")


@pytest.fixture(scope="session")
def lagging(nominal: kl.KoopmanModel) -> kl.KoopmanModel:
    """A robot whose motors follow over three periods, and a model with an input history of two
    commands that knows.
    """
    random, episodes = np.random.default_rng(5), []
    for _ in range(30):
        sent = random.uniform(-0.8, 0.8, (60, 2))
        padded = np.vstack([np.zeros((2, 2)), sent])
        acting = 0.5 * padded[2:] + 0.3 * padded[1:-1] + 0.2 * padded[:-2]
        episodes.append(kl.Episode(nominal.rollout(random.uniform(-1, 1, 3), acting), sent, DT))
    dictionary = kl.InputHistoryDictionary(
        kl.HermiteTrigDictionary(order=0), lags=(0, 1, 2), product=True
    )
    return kl.fit(kl.Dataset(episodes), dictionary)


@pytest.fixture(scope="session")
def models(
    nominal: kl.KoopmanModel,
    learned: kl.KoopmanModel,
    learned_edmdc: kl.KoopmanModel,
    lagging: kl.KoopmanModel,
) -> dict[str, kl.KoopmanModel]:
    return {
        "nominal": nominal,
        "learned": learned,
        "learned_edmdc": learned_edmdc,
        "lagging": lagging,
    }
