"""A board that is switched off and on while the robot drives: no way back, and no going on."""

import pytest
from boards import TABLES, Rig, distance
from waiting import until


@pytest.mark.parametrize("name", TABLES)
def test_a_restart_that_is_seen_after_a_gap_is_no_way_back(name, tmp_path):
    """The counters came back to zero by as much as wheels can turn in the gap: motion backward."""
    rig = Rig(name, f"pty:{tmp_path / 'link'}").connect()
    rig.is_ready()
    rig.starts(0.3, 0.0)
    rig.drive(0.3, 0.0, 0.6)
    rig.emulator.mute = True
    rig.drive(0.3, 0.0, 0.1)
    rig.emulator.reboot()
    rig.emulator.mute = False
    rig.drive(0.0, 0.0, 0.3)
    assert until(lambda: rig.driver.health().restarted or rig.counters["board_restarts"])
    rig.come_to_rest()
    assert rig.counters["board_restarts"] == 1
    assert distance(rig.driver, rig.emulator)[0] < 0.07
    assert until(lambda: not rig.driver.health().restarted)
    rig.close()
