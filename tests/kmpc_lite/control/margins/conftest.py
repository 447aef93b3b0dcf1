"""The model that tests of margins share."""

from __future__ import annotations

import pytest
from wary import slipping

import kmpc_lite as kl


@pytest.fixture(scope="session")
def model() -> kl.KoopmanModel:
    return slipping(0.1)
