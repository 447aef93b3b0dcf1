"""A board that is switched off and on while the robot drives: no way back, and no going on."""

import itertools
import time

import pytest
from boards import TABLES, Rig, distance
from waiting import until

from firmware_bridge.emulator.odrive import ODriveEmulator


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


def test_a_late_answer_of_one_axis_is_not_the_position_of_the_other(tmp_path, monkeypatch):
    """After a time-out the next question was for two numbers again, and got those of before."""
    rig = Rig("odrive", f"pty:{tmp_path / 'link'}").connect()
    rig.drive(0.3, 0.0, 0.3)
    asked = itertools.count()

    def late(self, data, answer=ODriveEmulator.handle):
        reply = answer(self, data)
        if data.startswith(b"f 1") and next(asked) % 3 == 0:
            time.sleep(0.07)  # its time-out, and the pause behind it
        return reply

    monkeypatch.setattr(ODriveEmulator, "handle", late)
    rig.drive(0.3, 0.0, 0.8)
    monkeypatch.undo()
    rig.come_to_rest()
    assert rig.counters["timeouts"] > 0 and rig.counters["odometry_jumps"] == 0
    assert max(distance(rig.driver, rig.emulator)) < 0.05
    rig.close()
