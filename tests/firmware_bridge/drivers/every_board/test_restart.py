"""A board that is switched off and on while the robot drives: no way back, and no going on."""

import pytest
from boards import distance
from waiting import until


def test_a_restart_that_is_seen_after_a_gap_is_no_way_back(rig):
    """The counters came back to zero by as much as wheels can turn in the gap: motion backward."""
    rig.connect()
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


def test_a_board_that_restarts_is_set_up_again(rig):
    rig.connect()
    rig.drive(0.8, 0.0, 0.8)  # farther than it could be believed to come back meanwhile
    rig.driver.send(0.0, 0.0)
    assert until(lambda: abs(rig.driver.state().v) < 1e-3)
    x = rig.driver.state().x
    rig.emulator.reboot()
    rig.drive(0.0, 0.0, 0.6)  # a change of the watchdog is noticed within half a second
    rig.is_ready()
    assert rig.driver.state().x == pytest.approx(x, abs=0.06)
    rig.starts(0.3, 0.0)
