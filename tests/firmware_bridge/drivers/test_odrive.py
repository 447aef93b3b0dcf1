"""ODrive: what only this driver does."""

import itertools
import time

import numpy as np
import pytest
from boards import GEOMETRY, Rig, distance, patient
from waiting import until

from firmware_bridge.drivers.odrive import ODriveDriver, ODriveOptions
from firmware_bridge.link import open_transport
from firmware_bridge.messages import ConfigError, LinkError
from kmpc_lab.emulator.odrive import ODriveEmulator


@pytest.fixture
def rig(tmp_path):
    rig = Rig("odrive", f"pty:{tmp_path}/port")
    yield rig
    rig.close()


def test_sets_watchdogs_and_closed_loop(rig):
    rig.connect()
    for axis in rig.emulator.axes:
        assert (
            axis.enable_watchdog and axis.watchdog_timeout == pytest.approx(0.3) and axis.state == 8
        )
    assert rig.driver.health().mode == "closed loop"


def test_firmware_without_line_ends_behind_checksums(rig):
    rig.emulator.line_end = b""
    rig.connect()
    assert until(lambda: rig.command(0.3, 0.0) or rig.emulator.pose[0] > 0.05)
    bad = [rig.counters["bad_bytes"] for _ in range(8) if not rig.drive(0.3, 0.0, 0.1)]
    assert 0 in np.diff(bad), "late replies of a busy machine aside, every byte is understood"


def test_expired_watchdog_is_cleared_only_while_standing_still_is_asked(rig):
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.emulator.axes[0].errors = 0x800
    rig.drive(0.3, 0.0, 0.5)
    assert (
        not rig.driver.health().ready
        and rig.emulator.axes[0].state == 1
        and rig.counters["refused_commands"] > 5
    )
    rig.drive(0.0, 0.0, 0.4)
    assert (
        rig.driver.health().ready
        and rig.driver.health().faults == ()
        and rig.emulator.axes[0].errors == 0
    )
    rig.drive(0.3, 0.0, 0.1)
    assert not rig.emulator.stopped


def test_other_errors_are_never_cleared_by_the_driver(rig):
    rig.connect()
    rig.drive(0.3, 0.0, 0.1)
    rig.emulator.axes[1].errors = 0x40
    rig.drive(0.0, 0.0, 0.4)
    assert (
        rig.emulator.axes[1].errors == 0x40 and "axis 1: motor failed" in rig.driver.health().faults
    )
    stamp = rig.driver.state().stamp
    assert until(lambda: rig.driver.state().stamp > stamp), (
        "the wheels may still turn: odometry goes on"
    )
    rig.emulator.axes[1].errors = 0
    assert until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)


def test_zeros_under_an_encoder_error_are_no_position(tmp_path):
    rig = Rig("odrive", f"pty:{tmp_path}/port", patient("odrive")).connect()
    assert until(lambda: rig.command(0.3, 0.0) or rig.driver.state().x > 0.05)
    # what rolls while its encoders are silent is a matter of time: this robot stands
    rig.come_to_rest()
    before = rig.driver.state()
    rig.emulator.axes[0].errors = 0x100
    assert until(lambda: not rig.driver.health().pose_ok)
    assert not rig.driver.health().ready
    assert rig.driver.state().x == pytest.approx(before.x, abs=1e-3)
    stamp = rig.driver.state().stamp
    assert not until(lambda: rig.driver.state().stamp > stamp, 0.2)
    rig.emulator.axes[0].errors = 0
    rig.is_ready()
    assert until(lambda: rig.driver.health().pose_ok)
    assert rig.driver.state().x == pytest.approx(rig.emulator.pose[0], abs=1e-3)
    rig.close()


def test_a_watchdog_that_the_board_does_not_take_is_reported(rig, monkeypatch):
    put = ODriveEmulator._put
    monkeypatch.setattr(
        ODriveEmulator,
        "_put",
        lambda self, n, name, w, now: None if "enable" in name else put(self, n, name, w, now),
    )
    with pytest.raises(LinkError, match="cannot drive: axis 0 did not take a watchdog of 0.3 s"):
        rig.driver.connect(0.4)


def test_an_axis_that_is_not_calibrated_is_reported(rig):
    rig.emulator.axes[1].calibrated = False
    with pytest.raises(LinkError, match="cannot drive: axis 1: invalid state"):
        rig.driver.connect(0.4)


@pytest.mark.parametrize("words", ["nan nan", "1e30 0.0", "0.0 1e9", "inf 0"])
def test_feedback_that_makes_no_sense_is_refused(rig, monkeypatch, words):
    rig.connect()
    command = ODriveEmulator._axis_command
    monkeypatch.setattr(
        ODriveEmulator,
        "_axis_command",
        lambda self, c, w, now: words if c == "f" else command(self, c, w, now),
    )
    assert until(lambda: rig.counters["refused_replies"] + rig.counters["odometry_jumps"] > 0)
    assert rig.driver.state().x == pytest.approx(0.0, abs=1e-6)
    monkeypatch.undo()
    assert until(lambda: rig.driver.health().ready and rig.driver.health().pose_ok)


@pytest.mark.parametrize("words", ["-1", "lu", "1.5", "nan", "99999999999999999999999"])
def test_error_register_that_makes_no_sense_is_refused(rig, monkeypatch, words):
    rig.connect()
    get = ODriveEmulator._get
    monkeypatch.setattr(
        ODriveEmulator,
        "_get",
        lambda self, number, name: words if name == "error" else get(self, number, name),
    )
    assert until(lambda: rig.counters["refused_replies"] + rig.counters["unexpected_replies"] > 0)
    monkeypatch.undo()
    assert until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)


@pytest.mark.parametrize(
    ("board", "message"),
    [
        ({"first_axis": 1}, "board.second_axis: expected another axis"),
        (
            {"command_timeout": 0.5},
            "board.command_timeout: expected less than the watchdog of 0.5 s",
        ),
        ({"checksum": "yes"}, "board.checksum: expected bool, got 'yes'"),
        ({"watchdog": 0}, "board.watchdog: expected 0.1 to 10 s, got 0"),
    ],
)
def test_bad_options_name_the_key(board, message):
    with pytest.raises(ConfigError) as caught:
        ODriveDriver.from_options(
            open_transport("pty:unused"), {"geometry": GEOMETRY, "board": board}
        )
    assert str(caught.value).startswith(message)
    assert ODriveOptions().checksum


def test_a_late_answer_of_one_axis_is_not_the_position_of_the_other(rig, monkeypatch):
    """After a time-out the next question was for two numbers again, and got those of before."""
    rig.connect()
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
