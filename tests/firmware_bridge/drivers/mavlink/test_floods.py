"""Floods on a MAVLink link: what they may cost those in command."""

import random

import pytest
from mavlink_rig import Rig, dialect

from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
from firmware_bridge.drivers.mavlink.core import ANSWER_PERIOD, MavlinkCore
from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.drivers.mavlink.telemetry import KEPT, StatusTexts


class CountingLock:
    """Counts how often it was taken, and watches what is done under it."""

    def __init__(self):
        self.holds, self.held = 0, False

    def __enter__(self):
        self.holds, self.held = self.holds + 1, True

    def __exit__(self, *error):
        self.held = False


def frames(system, count):
    codec = MavlinkCodec(system, 1)
    return [
        codec.encode(dialect.MAVLink_attitude_message(i, 0.1, 0.2, 0.3, 0.0, 0.0, 0.5))
        for i in range(count)
    ]


FLOODS = {
    "frames of another system": b"".join(frames(77, 1500)),
    "0xFE": b"\xfe" * 65536,
    "0xFD": b"\xfd" * 65536,
    "torn frames": b"".join(frame[:-3] for frame in frames(1, 1500)),
    "frames within frames": b"\xfd\x6e\x00\x00\x00\x00" * 11000,
    "noise": random.Random(3).randbytes(65536),
}


@pytest.mark.parametrize("name", FLOODS)
def test_a_flood_that_says_nothing_delays_nothing(name, monkeypatch):
    """The lock that the gate needs is not touched while rubbish and strangers are sorted out."""
    core, lock = MavlinkCore(MavlinkOptions(), lambda frame: None, 1.7e9), CountingLock()
    searched = []
    crc = dialect.x25crc

    def watched(data):
        searched.append(lock.held)
        return crc(data)

    monkeypatch.setattr(dialect, "x25crc", watched)
    data, good = FLOODS[name], b"".join(frames(1, 3))
    for at in range(0, len(data), 1024):
        core.receive(data[at : at + 1024], at * 1e-9, lock)
    assert lock.holds <= 2 and not any(searched)
    core.receive(bytes(300), 10.0, lock)  # whatever a half frame waits for
    core.receive(bytes(300), 20.0, lock)
    before = lock.holds
    core.receive(good, 30.0, lock)
    assert lock.holds == before + 3, "one hold for each message of ours"


def test_a_flood_of_questions_does_not_crowd_commands_out():
    rig = Rig()
    rig.run(1.0)
    codec, sent = MavlinkCodec(1, 1), len(rig.sent)
    for i in range(2000):
        question = codec.encode(dialect.MAVLink_timesync_message(0, 10**9 + i))
        rig.core.receive(question, rig.now + i * 0.0005)  # a second of it
    assert len(rig.sent) - sent <= 1.0 / ANSWER_PERIOD + 2


def test_texts_without_end_take_no_memory_and_no_time():
    words = StatusTexts()
    for i in range(1, 3000):
        chunk = dialect.MAVLink_statustext_message(4, b"x" * 50, i, 1)
        chunk.text = f"PreArm: {i}".ljust(50)
        words.on_text(chunk, i * 1e-5)
        whole = dialect.MAVLink_statustext_message(4, b"", 0, 0)
        whole.text = f"PreArm: {i}"
        words.on_text(whole, i * 1e-5)
    assert len(words._partial) <= KEPT and len(words.refusals(0.03)) <= KEPT
