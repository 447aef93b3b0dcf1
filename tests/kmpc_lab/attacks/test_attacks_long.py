"""Every flood against a bridge that drives, each beside the same drive in peace; then all at once.

KMPC_ATTACK_SECONDS says how long all of them last together (600 if it is not set).
"""

import os
import resource

import pytest

from firmware_bridge.safety.gate_settings import TICK
from kmpc_lab.attacks.floods import EVERYTHING, FLOODS
from kmpc_lab.attacks.table import measure
from kmpc_lab.attacks.trial import run

SECONDS = float(os.environ.get("KMPC_ATTACK_SECONDS", "600"))
pytestmark = [pytest.mark.long, pytest.mark.usefixtures("no_other_bridge")]


@pytest.mark.parametrize("flood", FLOODS, ids=lambda flood: f"{flood.surface.name}-{flood.name}")
def test_a_flood_costs_neither_the_gate_nor_the_stop(flood):
    """Twice what is promised: this machine may be busy with other tests."""
    (row,) = measure([flood])
    quiet, attacked = row.quiet, row.attacked
    assert attacked.late_p99() <= max(2.0 * TICK, 3.0 * quiet.late_p99())
    assert attacked.standstill <= 1.2 * quiet.standstill + 2.0 * TICK + quiet.late_p99()
    assert attacked.press <= max(5.0 * TICK, 3.0 * quiet.press)


def test_all_floods_together_for_long():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    floods, surface = (EVERYTHING, *EVERYTHING.also), EVERYTHING.surface
    quiet, attacked = run(surface, ()), run(surface, floods, seconds=SECONDS)
    assert len(attacked.late) > 0.5 * SECONDS / TICK
    assert attacked.late_p99() <= max(2.0 * TICK, 3.0 * quiet.late_p99())
    assert attacked.standstill <= 1.2 * quiet.standstill + 2.0 * TICK
    assert attacked.press <= max(5.0 * TICK, 3.0 * quiet.press)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert after - before < 200 * 1024, "kilobytes: what nobody can take in is not kept"
