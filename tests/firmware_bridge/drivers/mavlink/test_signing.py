"""Signed links as on the firmware: clocks that disagree, first frames that are refused."""

import time
from pathlib import Path

import pytest
from mavlink_rig import Rig, dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec, SigningStamp, signing_time
from firmware_bridge.drivers.mavlink.core import MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.messages import ConfigError
from kmpc_lab.emulator.rover.autopilot import HOLD

KEY = bytes(range(32))
FAILSAFE = {"FS_GCS_ENABLE": 1, "FS_GCS_TIMEOUT": 2, "FS_TIMEOUT": 0.5}


@pytest.fixture
def options(tmp_path: Path) -> MavlinkOptions:
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(0o600)
    return MavlinkOptions(arm=True, key_file=str(path))


def new_process(rig: Rig, options: MavlinkOptions, ahead: float) -> None:
    """Another process of ours, with the same ids, whose clock is so far from the vehicle's [s]."""
    rig.core = MavlinkCore(options, rig._write, time.time() + ahead)
    rig.core.tick(rig.now)  # as the driver's thread does, before anything is heard


def drives(rig: Rig) -> None:
    rig.until(lambda: rig.core.identified and rig.core.streams.answered, 5.0)
    rig.core.take(rig.now)
    rig.until(lambda: rig.ready, 10.0)
    rig.drive(0.4, 0.0, 2.0)
    assert rig.ready
    assert not rig.rover.stopped
    assert rig.rover.counters["failsafes"] == rig.core.counters["yielded"] == 0


@pytest.mark.parametrize(
    ("ahead", "starts"),
    [
        (0.0, 2),
        (3600.0, 2),
        (-1.5e9, 2),
        *[
            pytest.param(s, 4, marks=pytest.mark.long)
            for s in (0.0, -60.0, -3600.0, 3600.0, -1.5e9)
        ],
    ],
)
def test_every_start_drives_whatever_our_clock_says(
    options: MavlinkOptions, ahead: float, starts: int
) -> None:
    """The second start failed on the firmware: it was refused as older than the first."""
    rig = Rig(options, key=KEY, parameters=FAILSAFE)
    for _ in range(starts):
        new_process(rig, options, ahead)
        drives(rig)
        rig.core.stop(rig.now)
        rig.run(5.0)
        silent = rig.core
        rig.core = MavlinkCore(MavlinkOptions(system=9), lambda frame: True, 0.0)
        rig.run(10.0)
        assert rig.rover.mode == "HOLD"
        assert silent.counters["bad_signature"] == 0


def test_a_failsafe_that_acts_before_anything_was_driven_is_no_pilot(options: MavlinkOptions):
    rig = Rig(options, key=KEY, parameters=FAILSAFE)
    rig.take()
    rig.rover.autopilot.say(4, "GCS Failsafe")
    rig.rover.autopilot.failsafe = "GCS Failsafe"
    rig.rover.pilot_mode(HOLD)
    rig.run(0.3)
    assert not rig.ready
    rig.rover.autopilot.failsafe = ""
    rig.until(lambda: rig.ready, 5.0)
    assert rig.core.counters["overruled"] == 1


def test_a_pilot_that_chooses_hold_before_anything_was_driven_keeps_it(options: MavlinkOptions):
    rig = Rig(options, key=KEY, parameters=FAILSAFE)
    rig.take()
    rig.rover.pilot_mode(HOLD)
    rig.run(10.0)
    assert rig.rover.mode == "HOLD"
    assert not rig.ready
    assert rig.core.counters["overruled"] == 0


def test_the_first_port_obeys_what_is_unsigned_and_another_does_not() -> None:
    for port, obeyed in ((True, True), (False, False)):
        rig = Rig(MavlinkOptions(arm=True), key=KEY, accept_unsigned=port)
        rig.run(3.0)
        rig.core.take(rig.now)
        rig.run(5.0)
        assert rig.ready is obeyed
        assert rig.core.counters["signed"] > 0


def test_a_key_is_taken_while_disarmed_only_and_adds_a_minute() -> None:
    rig = Rig(MavlinkOptions(arm=True))
    rig.take()
    message = dialect.MAVLink_setup_signing_message(1, 1, tuple(KEY), 1000)
    rig.core._send(message)
    rig.run(0.5)
    assert any("Won't setup signing when armed" in text for _, text in rig.core.status_texts.texts)
    rig.rover.pilot_arm(False)
    rig.core._send(message)
    rig.run(0.5)
    codec: MavlinkCodec = rig.rover._codec
    assert codec._mav.signing.secret_key == KEY
    assert codec._mav.signing.timestamp >= 1000 + 60 * 100_000


def test_a_recording_is_refused_after_a_start_without_a_clock(tmp_path: Path) -> None:
    """The newest time stamp outlives the process; a frame of any age was accepted before."""
    key_file, recorded = str(tmp_path / "key"), 1.7e9
    vehicle = MavlinkCodec(1, 1, key=KEY, wall_time=recorded)
    beat = dialect.MAVLink_heartbeat_message(10, 3, 0, 0, 4, 3)
    recording = vehicle.encode(beat)
    vehicle.sign(KEY, signing_time(recorded + 600.0))
    ours = MavlinkCodec(255, 190, key=KEY, wall_time=0.0)
    assert len(ours.feed(recording + vehicle.encode(beat), 0.0)) == 2
    SigningStamp(key_file).keep(ours.newest_stamp, 5.0)

    later = SigningStamp(key_file)
    assert later.unix_time == pytest.approx(recorded + 600.0, abs=1e-3)
    restarted = MavlinkCodec(255, 190, key=KEY, wall_time=max(0.0, later.unix_time))
    assert restarted.feed(recording, 0.0) == [] and restarted.counters["bad_signature"] == 1
    assert len(restarted.feed(vehicle.encode(beat), 0.0)) == 1
    forgetful = MavlinkCodec(255, 190, key=KEY, wall_time=0.0)
    assert len(forgetful.feed(recording, 0.0)) == 1, "what the stamp is for"


def test_a_stamp_that_cannot_be_kept_or_read_is_reported(tmp_path: Path) -> None:
    stamp = SigningStamp(str(tmp_path / "none" / "key"))
    stamp.keep(5, 0.0)
    assert "cannot keep the signing time" in stamp.problem
    for text in ("soon", "-5", "9" * 40, ""):
        (tmp_path / "key.stamp").write_text(text)
        with pytest.raises(ConfigError, match=r"key\.stamp: expected one number"):
            SigningStamp(str(tmp_path / "key"))
