"""Acknowledgement, retry, and telemetry requests that take less where more is denied."""

from __future__ import annotations

from collections.abc import Sequence

from firmware_bridge.drivers.mavlink.commands import (
    ACCEPTED,
    ARM,
    DENIED,
    FAILED,
    IN_PROGRESS,
    SET_MESSAGE_INTERVAL,
    SET_MODE,
    CommandDesk,
)
from firmware_bridge.drivers.mavlink.streams import Stream, StreamRequests, rates_from


class Wire:
    def __init__(self) -> None:
        self.sent: list[tuple[int, tuple[float, ...], int]] = []
        self.desk = CommandDesk(self.send)

    def send(self, command: int, parameters: Sequence[float], confirmation: int) -> None:
        self.sent.append((command, tuple(parameters), confirmation))


def test_sent_again_until_acknowledged() -> None:
    wire = Wire()
    wire.desk.request(ARM, 1.0, now=0.0)
    for now in (0.1, 0.29, 0.31, 0.5, 0.65):
        wire.desk.tick(now)
    assert wire.sent == [(ARM, (1.0,), 0), (ARM, (1.0,), 1), (ARM, (1.0,), 2)]
    assert wire.desk.on_ack(ARM, ACCEPTED, 0.7)
    wire.desk.tick(99.0)
    assert len(wire.sent) == 3
    assert wire.desk.result(ARM) == ACCEPTED


def test_replies_to_another_command_are_not_ours() -> None:
    wire = Wire()
    wire.desk.request(ARM, 1.0, now=0.0)
    assert not wire.desk.on_ack(SET_MODE, ACCEPTED, 0.1)
    assert wire.desk.result(ARM) is None
    assert wire.desk.result(SET_MODE) is None


def test_a_patient_request_comes_back_after_a_refusal() -> None:
    wire = Wire()
    wire.desk.request(ARM, 1.0, now=0.0, patient=True)
    wire.desk.on_ack(ARM, FAILED, 0.1)
    wire.desk.tick(1.0)
    assert len(wire.sent) == 1
    wire.desk.tick(1.11)
    assert len(wire.sent) == 2
    wire.desk.on_ack(ARM, DENIED, 1.2)
    wire.desk.tick(60.0)
    assert len(wire.sent) == 2


def test_work_in_progress_is_waited_for() -> None:
    wire = Wire()
    wire.desk.request(ARM, 1.0, now=0.0)
    assert wire.desk.on_ack(ARM, IN_PROGRESS, 0.1)
    wire.desk.tick(1.0)
    assert len(wire.sent) == 1
    assert wire.desk.result(ARM) is None


def streams(wire: Wire, *rates: float) -> StreamRequests:
    return StreamRequests(
        wire.desk, (Stream(32, "LOCAL_POSITION_NED", rates), Stream(30, "ATTITUDE", rates))
    )


def test_one_request_at_a_time_and_less_after_a_denial() -> None:
    wire = Wire()
    requests = streams(wire, *rates_from(50.0))
    asked = []
    now = 0.0
    while not requests.answered:
        requests.tick(now)
        command, (message, interval), _ = wire.sent[-1]
        assert command == SET_MESSAGE_INTERVAL
        asked.append((message, interval))
        wire.desk.on_ack(command, DENIED if interval < 25_000 else ACCEPTED, now)
        requests.tick(now + 0.01)
        now += 0.05
    assert asked[:2] == [(32, 20_000), (30, 20_000)]
    assert sorted(set(asked[2:])) == [(30, 25_000), (32, 25_000)]
    assert [stream.rate for stream in requests.streams] == [40.0, 40.0]
    assert requests.refused() == ()


def test_what_is_given_at_no_rate_is_told() -> None:
    wire = Wire()
    requests = streams(wire, 40.0, 20.0)
    for i in range(12):
        requests.tick(i * 0.1)
        wire.desk.on_ack(
            SET_MESSAGE_INTERVAL, DENIED if wire.sent[-1][1][0] == 32 else ACCEPTED, i * 0.1
        )
    assert requests.answered
    assert requests.refused() == ("LOCAL_POSITION_NED",)


def test_a_stream_that_stops_is_asked_for_again() -> None:
    wire = Wire()
    requests = streams(wire, 40.0)
    now = 0.0
    for _ in range(200):
        now += 0.05
        requests.tick(now)
        wire.desk.on_ack(SET_MESSAGE_INTERVAL, ACCEPTED, now)
        requests.saw(30, now - 0.025)
        requests.saw(30, now)
    asked = [parameters[0] for _, parameters, _ in wire.sent]
    assert asked.count(30) == 1
    assert 5 <= asked.count(32) <= 7
