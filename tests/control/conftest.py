"""Models that the tests of the controller share; each is made once."""

from __future__ import annotations

import pytest

import kmpc_lite as kl

DT = 0.1


@pytest.fixture(scope="session")
def nominal() -> kl.KoopmanModel:
    return kl.nominal_unicycle(DT)


@pytest.fixture(scope="session")
def slipping_data() -> kl.Dataset:
    return kl.generate_dataset(kl.DifferentialDrive(0.05, seed=1), episodes=40, steps=60, dt=DT, seed=2)


@pytest.fixture(scope="session")
def learned(slipping_data: kl.Dataset) -> kl.KoopmanModel:
    """Integral fit of a slipping robot."""
    return kl.fit(slipping_data)


@pytest.fixture(scope="session")
def learned_edmdc(slipping_data: kl.Dataset) -> kl.KoopmanModel:
    """The paper's fit of a slipping robot."""
    return kl.fit(slipping_data, method="edmdc")


@pytest.fixture(scope="session")
def lagging(slipping_data: kl.Dataset) -> kl.KoopmanModel:
    """A model with an input history of two commands."""
    dictionary = kl.InputHistoryDictionary(kl.HermiteTrigDictionary(order=0), lags=(0, 1, 2), product=True)
    return kl.fit(slipping_data, dictionary)


@pytest.fixture(scope="session")
def models(
    nominal: kl.KoopmanModel, learned: kl.KoopmanModel, learned_edmdc: kl.KoopmanModel, lagging: kl.KoopmanModel
) -> dict[str, kl.KoopmanModel]:
    return {"nominal": nominal, "learned": learned, "learned_edmdc": learned_edmdc, "lagging": lagging}
