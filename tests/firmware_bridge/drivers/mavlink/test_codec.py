"""Bytes to messages: what no byte stream may do to us, and agreement with encoders that are not
ours.
"""

import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mavlink_rig import Rig, crc16_mcrf4xx, dialect, set_point_frame

from firmware_bridge.drivers.mavlink.codec import STALLED, MavlinkCodec
from firmware_bridge.drivers.mavlink.commands import MessageBuilder
from firmware_bridge.drivers.mavlink.options import MavlinkOptions

KEY = bytes(range(32))


def attitudes(
    count: int, version: int | None = 2, key: bytes | None = None, wall_time: float = 1.7e9
) -> list[bytes]:
    """Frames of a vehicle; version None mixes 1 and 2."""
    codec = MavlinkCodec(1, 1, key=key, wall_time=wall_time)
    return [
        codec.encode(
            dialect.MAVLink_attitude_message(1000 + i, 0.1, 0.2, 0.3, 0.0, 0.0, 0.5),
            version or 1 + i % 2,
        )
        for i in range(count)
    ]


def received(codec: MavlinkCodec, data: bytes, now: float = 0.0) -> list[int]:
    return [message.time_boot_ms for message in codec.feed(data, now)]


@given(st.floats(-3, 3, width=32), st.floats(-3, 3, width=32), st.floats(0, 1e7))
def test_set_point_agrees_with_the_message_definition_and_with_pymavlink(
    v: float, omega: float, now: float
) -> None:
    message = MessageBuilder(MavlinkOptions()).set_point(v, omega, now)
    ours = MavlinkCodec(255, 190).encode(message)
    boot_ms = int(now * 1000.0) % 2**32
    assert ours == set_point_frame(boot_ms, v, omega)
    theirs = dialect.MAVLink(None, srcSystem=255, srcComponent=190)
    zero = 0.0
    assert ours == theirs.set_position_target_local_ned_encode(
        boot_ms,
        1,
        1,
        8,
        0x5C7,
        zero,
        zero,
        zero,
        v,
        zero,
        zero,
        zero,
        zero,
        zero,
        zero,
        zero - omega,
    ).pack(theirs)


@settings(max_examples=50)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=60), st.integers(0, 2**32))
def test_any_split_of_the_stream_gives_the_same_messages(sizes: list[int], seed: int) -> None:
    noise = random.Random(seed)
    data = b"".join(
        noise.randbytes(noise.randrange(4)).replace(b"\xfd", b"").replace(b"\xfe", b"") + f
        for f in attitudes(20, None)
    )
    codec, got, start = MavlinkCodec(255, 190), [], 0
    for size in [*sizes, len(data)]:
        got += received(codec, data[start : start + size])
        start += size
    assert got == list(range(1000, 1020))


@pytest.mark.parametrize("byte", [1, 2, 9, 20, 39])
def test_a_corrupt_byte_costs_one_frame(byte: int) -> None:
    """Also in the length, where pymavlink's own parser loses seven."""
    frames = attitudes(12)
    for flip in (0x01, 0x40, 0xFF):
        spoilt = bytearray(b"".join(frames))
        spoilt[len(frames[0]) + byte % len(frames[1])] ^= flip
        codec = MavlinkCodec(255, 190)
        # what a wrong length makes it wait for comes, or the time for it runs out
        got = (
            received(codec, bytes(spoilt))
            + received(codec, b"", 0.0)
            + received(codec, b"", STALLED)
        )
        assert got == [1000, *range(1002, 1012)]
        assert codec.counters["skipped_bytes"] == len(frames[1])


@pytest.mark.parametrize("thousands", [200, pytest.param(1000, marks=pytest.mark.long)])
def test_random_bytes(thousands: int) -> None:
    noise, codec, good = random.Random(7), MavlinkCodec(255, 190), b"".join(attitudes(3))
    found = 0
    for i in range(thousands):
        found += len(codec.feed(noise.randbytes(1000), i * 0.01))
        if i % 100 == 99:
            codec.feed(b"", i * 0.01 + STALLED)
            codec.feed(b"", i * 0.01 + 2 * STALLED)
            # whatever half frame the noise ended in has had its time
            assert received(codec, bytes(300) + good, i * 0.01 + 3 * STALLED)[-3:] == [
                1000,
                1001,
                1002,
            ]
        assert len(codec._buffer) < 600
    assert found < 20
    assert codec.counters["skipped_bytes"] > 990 * thousands


@pytest.mark.parametrize("enough", [100_000, pytest.param(1_000_000, marks=pytest.mark.long)])
def test_frames_with_random_content_go_through_all_handlers(enough: int) -> None:
    """Right CRC, our vehicle's ids, random payloads: every handler meets every number."""
    noise, rig = random.Random(3), Rig(MavlinkOptions(arm=True))
    rig.take()
    kinds = [kind for kind in dialect.mavlink_map.values() if kind.unpacker.size]
    handled = [
        kind for kind in kinds if kind.id in (0, 2, 22, 24, 30, 32, 49, 77, 84, 111, 193, 253)
    ]
    size = 0
    while size < enough:
        chunk = bytearray()
        for _ in range(50):
            kind = noise.choice(handled if noise.random() < 0.7 else kinds)
            payload = noise.choice(
                (
                    noise.randbytes(kind.unpacker.size),
                    b"\0" * kind.unpacker.size,
                    b"\xff" * kind.unpacker.size,
                )
            )
            head = struct.pack(
                "<BBBBBB", len(payload), 0, 0, 0, noise.choice((1, 1, 1, 7)), 1
            ) + kind.id.to_bytes(3, "little")
            chunk += (
                b"\xfd"
                + head
                + payload
                + struct.pack("<H", crc16_mcrf4xx(head + payload + bytes((kind.crc_extra,))))
            )
            if noise.random() < 0.1:
                chunk += noise.randbytes(30)
        size += len(chunk)
        rig.now += 0.01
        rig.core.receive(bytes(chunk), rig.now)
        rig.core.tick(rig.now)
        state = rig.core.state
        assert state is None or abs(state.x) <= 1e5 and state.stamp <= rig.now
        rig.core.status(rig.now, True)
    assert rig.core.counters["refused_telemetry"] > 0


def test_values_that_do_not_fit_their_field() -> None:
    codec = MavlinkCodec(255, 190)
    with pytest.raises(ValueError, match="ATTITUDE"):
        codec.encode(dialect.MAVLink_attitude_message(2**32, 0, 0, 0, 0, 0, 0))
    with pytest.raises(ValueError, match="ATTITUDE"):
        codec.encode(dialect.MAVLink_attitude_message(0, 1e300, 0, 0, 0, 0, 0))


class TestSigning:
    """With a key, unsigned or wrongly signed traffic is refused and counted."""

    def codec(self) -> MavlinkCodec:
        return MavlinkCodec(255, 190, key=KEY, wall_time=1.7e9)

    def test_signed_is_taken_and_ours_is_signed(self) -> None:
        codec = self.codec()
        assert received(codec, b"".join(attitudes(3, key=KEY))) == [1000, 1001, 1002]
        frame = codec.encode(dialect.MAVLink_attitude_message(1, 0, 0, 0, 0, 0, 0))
        vehicle = dialect.MAVLink(None)
        vehicle.signing.secret_key = KEY
        assert vehicle.decode(bytearray(frame)).get_signed()

    def test_unsigned_is_refused(self) -> None:
        codec = self.codec()
        assert received(codec, b"".join(attitudes(4, None))) == []
        assert (
            codec.counters["unsigned"],
            codec.counters["bad_signature"],
            codec.counters["bad_data"],
        ) == (4, 0, 0)

    def test_a_recording_is_refused(self) -> None:
        codec, recording = self.codec(), b"".join(attitudes(2, key=KEY))
        assert received(codec, recording) == [1000, 1001]
        assert received(codec, recording) == []
        assert codec.counters["bad_signature"] == 2

    def test_a_forged_frame_does_not_shut_the_true_ones_out(self) -> None:
        codec, (first, *rest) = self.codec(), attitudes(4, key=KEY)
        forged = bytearray(first)
        forged[-12:-6] = (
            b"\xff" * 6
        )  # a time stamp far ahead, under a signature that is wrong for it
        assert received(codec, bytes(forged) + first + bytes(forged) + b"".join(rest)) == [
            1000,
            1001,
            1002,
            1003,
        ]
        assert codec.counters["bad_signature"] == 2
