"""Acknowledgement, retry, and telemetry requests that take less where more is denied."""

from collections.abc import Sequence

from firmware_bridge.drivers.mavlink.commands import (
    ACCEPTED,
    ARM,
    DENIED,
    IN_PROGRESS,
    SET_MESSAGE_INTERVAL,
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


def test_what_is_given_at_no_rate_is_reported() -> None:
    wire = Wire()
    requests = streams(wire, 40.0, 20.0)
    for i in range(12):
        requests.tick(i * 0.1)
        wire.desk.on_ack(
            SET_MESSAGE_INTERVAL, DENIED if wire.sent[-1][1][0] == 32 else ACCEPTED, i * 0.1
        )
    assert requests.answered
    assert requests.refused() == ("LOCAL_POSITION_NED",)
