"""Beams made turns: when one ends, when each beam was measured, what is no turn."""

from __future__ import annotations

import math
import random

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from firmware_bridge.sensors.lidar.ld06 import SIZE, Ld06Packet, Ld06Packets, crc8
from firmware_bridge.sensors.lidar.lidar import LONGEST, Turns
from firmware_bridge.sensors.lidar.rplidar import (
    CIRCLE,
    GET_HEALTH,
    GET_INFO,
    HEALTH,
    INFO,
    NODES,
    PROOF,
    RESET,
    SCAN,
    SET_PWM,
    STOP,
    Node,
    RplidarAnswers,
    descriptor,
    request,
)


def spin(turns, began, took, count=100):
    """A turn from a time on [s]; gives the time at its end."""
    turns.add([math.tau * (count - 1) / count], [2.0], began)  # of the turn before
    turns.add([math.tau * i / count for i in range(count)], [2.0] * count, began)
    return began + took


def end(turns, stamp):
    """The next turn begins."""
    turns.add([0.0], [2.0], stamp)


def test_a_turn_is_stamped_by_its_angles():
    turns = Turns(0.1, 12.0)
    over = spin(turns, 10.0, 0.2)
    assert turns.newest is None
    end(turns, over)
    sweep = turns.newest
    assert sweep.stamps[0] == pytest.approx(10.0) and sweep.stamps[50] == pytest.approx(10.1)
    assert sweep.stamp == pytest.approx(10.198) and np.all(np.diff(sweep.stamps) > 0.0)
    assert sweep.angles[25] == pytest.approx(-math.pi / 2)  # clockwise, reported counter-clockwise
    assert turns.rate(10.3) == pytest.approx(5.0) and turns.rate(13.0) == 0.0


@pytest.mark.parametrize(
    ("angles", "took"),
    [
        ([0.1] * 200, 0.1),  # a motor that is stuck
        ([0.05 * i for i in range(40)], 0.1),  # a third of a turn
        ([math.tau * i / 10 for i in range(10)], 0.1),
        ([math.tau * i / 100 for i in range(100)], 3.0),
        ([math.tau * i / 100 for i in range(100)], 0.001),
    ],
)
def test_what_is_no_turn_is_counted(angles, took):
    turns = Turns(0.1, 12.0)
    turns.add([6.2, *angles, 6.2], [1.0] * (len(angles) + 2), 1.0)
    end(turns, 1.0 + took)
    assert turns.newest is None and turns.counters["broken_turns"] == 1


def test_beams_without_end_are_bounded():
    turns = Turns(0.1, 12.0)
    for _ in range(100):
        turns.add([0.1] * 1000, [1.0] * 1000, 1.0)
    assert len(turns._angles) <= LONGEST + 1000 and turns.counters["broken_turns"] >= 9


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


@pytest.mark.parametrize(
    ("command", "payload", "wire"),
    [
        (STOP, b"", "a5 25"),
        (RESET, b"", "a5 40"),
        (SCAN, b"", "a5 20"),
        (GET_INFO, b"", "a5 50"),
        (GET_HEALTH, b"", "a5 52"),
        (SET_PWM, b"\x94\x02", "a5 f0 02 94 02 c1"),
    ],
)
def test_requests_are_those_of_the_protocol(command, payload, wire):
    assert request(command, payload).hex(" ") == wire


@pytest.mark.parametrize(
    ("kind", "wire"),
    [
        (NODES, "a5 5a 05 00 00 40 81"),
        (INFO, "a5 5a 14 00 00 00 04"),
        (HEALTH, "a5 5a 03 00 00 00 06"),
    ],
)
def test_answers_begin_as_the_protocol_says(kind, wire):
    assert descriptor(kind).hex(" ") == wire


def turn(count=360, first=0):
    return [
        Node((first + i) % count * CIRCLE // count, 4 * (1000 + i), 15, (first + i) % count == 0)
        for i in range(count)
    ]


def test_answers_then_nodes_however_the_bytes_are_cut():
    info = bytes((0x18, 29, 1, 7)) + bytes(range(16))
    data = b"RP LIDAR System.\r\n" + descriptor(INFO) + info + descriptor(HEALTH) + b"\1\2\0"
    data += descriptor(NODES) + b"".join(n.to_bytes() for n in turn())
    for size in (1, 3, 7, 1024):
        decoder, answers, nodes = RplidarAnswers(), [], []
        for at in range(0, len(data), size):
            more = decoder.feed(data[at : at + size])
            answers += more[0]
            nodes += more[1]
        assert answers == [(INFO, info), (HEALTH, b"\1\2\0")] and nodes == turn()[:-1]
        assert decoder.bad == 18 and decoder.losses == 0


@given(st.binary(max_size=600))
def test_noise_is_bounded_and_holds_nothing_up(noise):
    decoder = RplidarAnswers()
    decoder.feed(noise)
    assert len(decoder._buffer) < 64 and len(decoder._proven) <= PROOF
    decoder.reset()
    data = descriptor(NODES) + b"".join(n.to_bytes() for n in turn(36))
    assert decoder.feed(data)[1] == turn(36)[:-1]
