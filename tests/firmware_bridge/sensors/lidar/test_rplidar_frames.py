"""Requests, answers and nodes of the RPLIDAR: the protocol's bytes, noise, and lost bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

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
