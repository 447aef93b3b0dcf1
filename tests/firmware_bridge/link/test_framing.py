"""Vectors from the manuals, and noise for each decoder."""

import random
import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from firmware_bridge.link.framing import (
    LINE_BYTES,
    Lines,
    RoboClawPackets,
    RoboClawReplies,
    VescPackets,
    crc16,
    odrive_line,
    odrive_text,
    roboclaw_packet,
    roboclaw_reply,
    roboclaw_request,
    vesc_packet,
)
from kmpc_lab.emulator.roboclaw import WRITES

NOISE = 200_000  # bytes that each decoder is given


def chunks(data, seed=0, longest=200):
    """Cut bytes at random places."""
    cut = random.Random(seed)
    at = 0
    while at < len(data):
        size = cut.randint(1, longest)
        yield data[at : at + size]
        at += size


def test_vectors():
    assert crc16(b"123456789") == 0x31C3
    assert (
        roboclaw_packet(0x80, 37, struct.pack(">ii", 1000, -1000)).hex(" ")
        == "80 25 00 00 03 e8 ff ff fc 18 82 90"
    )
    assert roboclaw_packet(0x80, 14, b"\x03").hex(" ") == "80 0e 03 28 36"
    assert roboclaw_request(0x81, 78) == b"\x81\x4e"
    assert vesc_packet(b"\x04").hex(" ") == "02 01 04 40 84 03"
    assert vesc_packet(struct.pack(">Bi", 8, 3000)).hex(" ") == "02 05 08 00 00 0b b8 f8 04 03"
    assert odrive_line("r vbus_voltage ", True) == b"r vbus_voltage *93\n"
    assert odrive_line("v 0 1.5 0", False) == b"v 0 1.5 0\n"


@given(st.binary(min_size=1, max_size=512), st.integers(0, 3))
def test_vesc_round_trip_byte_by_byte(payload, offset):
    frame = vesc_packet(payload)
    assert frame[0] == (2 if len(payload) < 256 else 3)
    decoder, found = VescPackets(), []
    for at in range(0, len(frame) + offset, offset + 1):
        found += decoder.feed(frame[at : at + offset + 1], 0.0)
    assert found == [payload] and decoder.bad == 0


@given(st.integers(0x80, 0x87), st.sampled_from(sorted(WRITES)), st.randoms(use_true_random=False))
def test_roboclaw_round_trip(address, command, rng):
    payload = rng.randbytes(WRITES[command])
    decoder = RoboClawPackets(address, WRITES)
    frames = roboclaw_packet(address, command, payload) + roboclaw_request(address, 78)
    found = [
        packet for i in range(len(frames)) for packet in decoder.feed(frames[i : i + 1], i * 0.001)
    ]
    assert found == [(command, payload), (78, b"")] and decoder.bad == 0


@given(st.binary(min_size=1, max_size=40), st.integers(0, 7), st.data())
def test_a_frame_with_a_bit_flipped_is_none(payload, bit, data):
    write, replies = roboclaw_packet(0x80, 37, payload[:1] * WRITES[37]), RoboClawReplies()
    replies.expect(0x80, 78, 8)
    for frame, decode in (
        (vesc_packet(payload), lambda bent: len(payload) in map(len, VescPackets().feed(bent))),
        (write, lambda bent: 37 in dict(RoboClawPackets(0x80, WRITES).feed(bent))),
        (roboclaw_reply(0x80, 78, bytes(8)), replies.feed),
    ):
        bent = bytearray(frame)
        bent[data.draw(st.integers(0, len(frame) - 1))] ^= 1 << bit
        assert not decode(bytes(bent))


def test_roboclaw_reply_for_another_command_or_address_is_no_answer():
    replies = RoboClawReplies()
    replies.expect(0x80, 78, 8)
    assert replies.feed(roboclaw_reply(0x80, 79, bytes(range(8)))) is None
    assert replies.feed(roboclaw_reply(0x81, 78, bytes(range(8)))) is None
    assert replies.feed(roboclaw_reply(0x80, 78, bytes(range(8)))) == bytes(range(8))


def test_vesc_corrupt_length_loses_no_later_frame():
    good = [bytes((4, i)) for i in range(60)]
    stream = bytearray(b"".join(map(vesc_packet, good)))
    stream[1] = 90
    decoder = VescPackets(128)
    found = [payload for chunk in chunks(bytes(stream)) for payload in decoder.feed(chunk, 0.0)]
    assert found == good[1:]


@pytest.mark.parametrize("line", [b"1.0 2.0*3", b"1.0 2.0*x", b"", b"1\x002", b"1*" + b"9" * 200])
def test_odrive_damaged_lines(line):
    assert odrive_text(line, checksum=True) is None


@given(
    st.lists(
        st.text(
            st.characters(min_codepoint=32, max_codepoint=126, exclude_characters="*"),
            min_size=1,
            max_size=40,
        ),
        max_size=20,
    )
)
def test_odrive_lines_round_trip_in_pieces(texts):
    texts = [text for text in texts if text.strip()]
    lines, found = Lines(), []
    for chunk in chunks(b"".join(odrive_line(text, True) for text in texts), longest=7):
        found += lines.feed(chunk)
    assert [odrive_text(line, True) for line in found] == [text.strip() for text in texts]


def noise(seed):
    """Random bytes: half of them uniform, half of them starts and stops of frames."""
    rng = random.Random(seed)
    return rng.randbytes(NOISE // 2) + bytes(
        rng.choices(b"\x02\x03\x80\x25\x0e\x00\xff*\r\n0 1.", k=NOISE // 2)
    )


def test_fuzz_vesc():
    decoder, good = VescPackets(), vesc_packet(b"\x04good")
    for i, chunk in enumerate(chunks(noise(1))):
        for payload in decoder.feed(chunk, i * 1e-3):
            assert 1 <= len(payload) <= 512
        assert len(decoder._buffer) <= 512 + 6
    assert b"\x04good" in decoder.feed(good * 200, 1e9)
    assert decoder.feed(good, 1e9)[-1:] == [b"\x04good"]


def test_fuzz_roboclaw_driver_side():
    replies, wrong = RoboClawReplies(), 0
    replies.expect(0x80, 78, 8)
    for chunk in chunks(noise(3)):
        if replies.feed(chunk) is not None:
            wrong += 1  # 16 bits of CRC let one in 65,536 places through
            replies.expect(0x80, 78, 8)
        assert len(replies._buffer) < 10
    assert wrong < 60
    assert replies.feed(roboclaw_reply(0x80, 78, bytes(8))) == bytes(8)


def test_fuzz_odrive():
    lines, texts = Lines(), 0
    for chunk in chunks(noise(4)):
        for line in lines.feed(chunk):
            assert len(line) <= LINE_BYTES
            texts += odrive_text(line, checksum=True) is not None
        assert len(lines._buffer) <= LINE_BYTES
    lines.feed(b"\n")
    assert [odrive_text(line, True) for line in lines.feed(odrive_line("1 2", True))] == ["1 2"]
