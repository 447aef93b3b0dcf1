"""Bad input that each protocol meets: false starts, wrong CRCs, answers to other questions."""

import pytest
from boards import Rig
from waiting import until

from firmware_bridge.link.framing import (
    ROBOCLAW_ACK,
    Lines,
    RoboClawPackets,
    RoboClawReplies,
    VescPackets,
    odrive_line,
    roboclaw_packet,
    roboclaw_reply,
    vesc_packet,
)

ADDRESS, COUNTS = 0x80, 78


def vesc(stray: bytes) -> tuple[list[bytes], int]:
    decoder = VescPackets(128)
    found = (
        decoder.feed(stray, 0.0)
        + decoder.feed(vesc_packet(b"\x04\x01"), 0.001)
        + decoder.feed(vesc_packet(b"\x04\x02"), 0.3)
    )
    return found, decoder.bad


@pytest.mark.parametrize(
    "stray", [b"\x02", b"\x02\x02", b"\x02\x05", b"\x03\x00", b"\x02\x01\x04", b"\x02\x03\x02\x03"]
)
def test_false_starts_cost_a_vesc_one_frame_at_most(stray):
    found, bad = vesc(stray)
    # a length that the next frame does not fill holds that frame back until it is too old to count
    assert (
        found[-1] == b"\x04\x02"
        and (b"\x04\x01" in found or stray == b"\x02\x05")
        and bad >= len(stray)
    )


@pytest.mark.parametrize("stray", [b"\x80", b"\x80\x25", b"\x00\x80\x25\x00", b"\xff\xff"])
def test_false_starts_cost_a_roboclaw_one_packet_at_most(stray):
    board = RoboClawPackets(ADDRESS, {37: 8})
    board.feed(stray, 0.0)
    assert board.feed(roboclaw_packet(ADDRESS, 37, bytes(8)), 0.02) == [
        (37, bytes(8))
    ] and board.bad >= len(stray)
    driver = RoboClawReplies()
    driver.expect(ADDRESS, COUNTS, 8)
    assert driver.feed(stray) is None
    assert driver.feed(
        roboclaw_reply(ADDRESS, COUNTS, b"\0\0\0\1\0\0\0\2")
    ) == b"\0\0\0\1\0\0\0\2" and driver.bad == len(stray)


@pytest.mark.parametrize("stray", [b"*", b"\xff\xfe*12", b"1.0 2.0"])
def test_false_starts_cost_an_odrive_one_line_at_most(stray):
    lines = Lines()
    assert lines.feed(stray) == []
    found = lines.feed(b"\n" + odrive_line("3.0 4.0", True) + odrive_line("5.0 6.0", True))
    assert found[-2:] == [odrive_line("3.0 4.0", True)[:-1], odrive_line("5.0 6.0", True)[:-1]]


@pytest.mark.parametrize(
    "stray",
    [b"\xfd", b"\xfe", b"\xfd\x09", b"\xfd\xfd\xfd", b"\xfe\xff\xfd", b"\xfe\x1c\x00\x01\x01\x1e"],
)
def test_false_starts_cost_mavlink_no_frame(stray):
    dialect = pytest.importorskip("pymavlink.dialects.v20.ardupilotmega")
    from firmware_bridge.drivers.mavlink.codec import STALLED, MavlinkCodec

    vehicle, codec = dialect.MAVLink(None, srcSystem=1, srcComponent=1), MavlinkCodec(255, 190)
    frames = [
        bytes(dialect.MAVLink_attitude_message(k, 0.0, 0.0, 0.1 * k, 0.0, 0.0, 0.2).pack(vehicle))
        for k in (1, 2, 3)
    ]
    found = (
        codec.feed(stray + frames[0], 0.0)
        + codec.feed(frames[1], 0.01)
        + codec.feed(frames[2], 0.02 + STALLED)
    )
    assert [message.time_boot_ms for message in found] == [1, 2, 3]
    assert codec.counters["skipped_bytes"] == len(stray)


@pytest.fixture(params=["roboclaw", "odrive", "vesc"])
def rig(request, tmp_path):
    rig = Rig(request.param, f"pty:{tmp_path}/port")
    yield rig
    rig.close()


def test_replies_with_a_wrong_crc_are_counted_and_believed_by_nobody(rig, monkeypatch):
    rig.connect()
    answer = rig.emulator.handle
    before, state = dict(rig.counters), rig.driver.state()

    def damaged(data: bytes) -> bytes:
        reply = bytearray(answer(data))
        if len(reply) > 4:
            # a bit of the payload, at which neither length nor end would tell
            reply[2 if rig.name != "odrive" else 0] ^= 0x01
        return bytes(reply)

    monkeypatch.setattr(rig.emulator, "handle", damaged)
    rig.drive(0.2, 0.0, 0.6)  # enough questions on a busy machine too
    told = {
        name: rig.counters[name] - before[name]
        for name in ("bad_bytes", "timeouts", "unexpected_replies", "refused_replies")
    }
    assert told["timeouts"] > 3 and (
        told["bad_bytes"] > 10 or told["unexpected_replies"] > 3 or rig.name == "odrive"
    )
    assert rig.driver.state().stamp - state.stamp < 0.1 and rig.driver.state().x == pytest.approx(
        0.0, abs=0.02
    )
    monkeypatch.undo()
    rig.drive(0.0, 0.0, 0.2)
    assert until(lambda: rig.driver.send(0.0, 0.0) or rig.driver.health().ready)


def test_an_acknowledgement_alone_is_no_answer_to_a_question():
    driver = RoboClawReplies()
    driver.expect(ADDRESS, COUNTS, 8)
    assert driver.feed(bytes((ROBOCLAW_ACK,)) * 3) is None
