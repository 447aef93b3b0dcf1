"""One profile for the property tests, and where the bridge's commands are run.

The same examples in every run; HYPOTHESIS_PROFILE=random looks for new ones.
"""

from __future__ import annotations

import os

from bridge_desk import desk as desk
from bridge_desk import no_other_bridge as no_other_bridge
from hypothesis import settings

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("random", deadline=None)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "repeatable"))


def pytest_xdist_auto_num_workers() -> int:
    """Two more than there are cores: tests of links wait more than they compute."""
    return len(os.sched_getaffinity(0)) + 2
