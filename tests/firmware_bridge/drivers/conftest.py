"""A clock of the tests' own."""

import pytest
from robots import Clock


@pytest.fixture
def clock():
    return Clock()
