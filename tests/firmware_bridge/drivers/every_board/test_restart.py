"""A board that is switched off and on while the robot drives: no way back, and no going on."""

import pytest
from waiting import until


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
