"""A driver and an emulator of each serial board."""

import pytest
from boards import TABLES, Rig


@pytest.fixture(params=TABLES)
def name(request):
    return request.param


@pytest.fixture
def rig(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port")
    yield rig
    rig.close()
