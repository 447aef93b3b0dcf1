"""What every serial board says of a port, a robot file or a baud rate that is wrong."""

from __future__ import annotations

import threading

import pytest
from boards import DRIVERS, EMULATORS, TABLES, Rig
from waiting import until

from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError


def test_a_silent_board_is_reported_in_words(name, tmp_path):
    rig = Rig(name, f"pty:{tmp_path}/port")
    rig.emulator.mute = True
    with pytest.raises(LinkError, match="no answer within 0.3 s: is it powered, wired TX to RX"):
        rig.driver.connect(0.3)
    assert threading.active_count() < 10
    rig.close()


def test_wrong_baud_is_reported_in_words(name, tmp_path):
    floor = {"baud": 115200}
    emulator = EMULATORS[name].from_options(TABLES[name], **floor)
    emulator.start(f"pty:{tmp_path}/port")
    driver = DRIVERS[name].from_options(
        open_transport(f"serial:{tmp_path}/port?baud=57600"), TABLES[name]
    )
    with pytest.raises(LinkError, match="baud rate"):
        driver.connect(0.3)
    right = DRIVERS[name].from_options(
        open_transport(f"serial:{tmp_path}/port?baud=115200"), TABLES[name]
    )
    right.connect(20.0)
    assert right.health().ready
    right.close()
    emulator.close()


@pytest.mark.parametrize(
    ("section", "change", "message"),
    [
        ("board", {"baud": 1}, "board.baud: unknown key"),
        ("board", {"poll_hz": "fast"}, "board.poll_hz: expected float"),
        ("board", {"poll_hz": 0}, "board.poll_hz: expected 5 to 200 Hz"),
        ("board", {"command_timeout": -1}, "board.command_timeout: expected 0.05"),
        ("geometry", {"track": 0}, "geometry.track: expected 0.01 to 100 m, got 0"),
    ],
)
def test_bad_robot_files_name_the_key(name, section, change, message):
    table = {**TABLES[name], section: {**TABLES[name][section], **change}}
    with pytest.raises(ConfigError) as caught:
        DRIVERS[name].from_options(open_transport("pty:unused"), table)
    assert str(caught.value).startswith(message)


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
