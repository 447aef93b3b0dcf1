"""Packets of the LD06 and LD19: the manual's example, noise, and lost bytes."""

import random

from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_bridge.sensors.lidar.ld06 import SIZE, Ld06Packet, Ld06Packets, crc8

MANUAL = bytes.fromhex(
    "54 2C 68 08 AB 7E E0 00 E4 DC 00 E2 D9 00 E5 D5 00 E3 D3 00 E4 D0 00 E9 CD 00 E4 CA 00 E2 "
    "C7 00 E9 C5 00 E5 C2 00 E5 C0 00 E5 BE 82 3A 1A 50"
)
"""Example of LDROBOT's development manual."""
packets = st.builds(
    Ld06Packet,
    speed=st.integers(0, 65535),
    start=st.integers(0, 35999),
    points=st.lists(
        st.tuples(st.integers(0, 65535), st.integers(0, 255)), min_size=12, max_size=12
    ).map(tuple),
    end=st.integers(0, 35999),
    time=st.integers(0, 30000),
)


def test_the_example_of_the_manual():
    (packet,) = Ld06Packets().feed(MANUAL)
    assert (packet.speed, packet.start, packet.end, packet.time) == (2152, 32427, 33470, 6714)
    assert packet.points[0] == (224, 228) and packet.points[11] == (192, 229)
    assert packet.to_bytes() == MANUAL and crc8(MANUAL[:-1]) == 0x50
    assert packet.angles[0] == 32427 and packet.angles[-1] == 33470


@settings(max_examples=30)
@given(st.lists(packets, max_size=3), st.integers(1, 60))
def test_every_packet_comes_back_however_the_bytes_are_cut(sent, size):
    data, decoder = b"".join(p.to_bytes() for p in sent), Ld06Packets()
    found = [p for at in range(0, len(data), size) for p in decoder.feed(data[at : at + size])]
    assert found == sent and decoder.bad == 0


def test_a_damaged_packet_is_lost_alone():
    rng, decoder = random.Random(1), Ld06Packets()
    for k in range(200):
        broken = bytearray(MANUAL)
        broken[rng.randrange(SIZE)] ^= 1 << rng.randrange(8)
        cut = MANUAL[: rng.randrange(1, SIZE)]
        found = decoder.feed((bytes(broken) if k % 2 else cut) + MANUAL)
        assert [p.to_bytes() for p in found] == [MANUAL]
    assert decoder.bad_crc >= 100
