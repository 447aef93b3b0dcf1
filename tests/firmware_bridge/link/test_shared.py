"""A shared link: which station hears what, and how little of theirs reaches the board at once."""

import pytest
from robots import Clock

from firmware_bridge.link.shared import (
    BURST,
    RATE,
    TOLD_AGAIN,
    TOLD_ELSE,
    WAITING,
    Portions,
    SharedTransport,
)
from firmware_bridge.messages import LinkError


class FakeLink:
    def __init__(self, broken: bool = False) -> None:
        self.written: list[bytes] = []
        self.broken, self.closed = broken, False
        self.counters, self.connected, self.last_error = {"bytes_in": 3}, True, ""

    def start(self, on_bytes) -> None:
        if self.broken:
            raise LinkError("nobody there")
        self.hear = on_bytes

    def write(self, data: bytes) -> bool:
        self.written.append(data)
        return True

    def close(self) -> None:
        self.closed = True


class Rules:
    """Lines; those that begin with "go" do not pass."""

    def cut(self):
        rest = b""

        def frames(data: bytes, now: float):
            nonlocal rest
            *whole, rest = (rest + data).split(b"\n")
            yield from whole

        return frames

    def judge(self, frame: bytes) -> str:
        return frame.decode() if frame.startswith(b"go") else ""

    def tell(self, text: str) -> bytes:
        return text.encode()


def shared(*broken: bool):
    clock, board = Clock(), FakeLink()
    stations = [FakeLink(b) for b in broken or (False, False)]
    return SharedTransport(board, stations, Rules(), clock), board, stations, clock


def test_stations_hear_all_that_the_board_says_and_the_board_what_they_may_say():
    link, board, (one, two), _ = shared()
    heard = []
    link.start(lambda data, stamp: heard.append(data))
    board.hear(b"pose", 1.0)
    assert heard == [b"pose"] and one.written == two.written == [b"pose"]
    one.hear(b"param", 1.0)
    two.hear(b"mode\ngo there\n", 1.0)
    one.hear(b"eter\n", 1.0)
    assert board.written == [b"mode", b"parameter"] and link.write(b"ours")
    assert link.counters == {
        "bytes_in": 3,
        "stations_passed": 2,
        "stations_refused": 1,
        "stations_dropped": 0,
    }
    assert (
        link.refusal == "go there"
        and two.written[-1] == b"kmpc refused go there"
        and len(one.written) == 1
    )
    link.close()
    assert board.closed and one.closed and two.closed


def test_a_station_refused_again_and_again_is_warned_now_and_then():
    link, _, (one, _), clock = shared()
    link.start(lambda data, stamp: None)
    for _ in range(100):
        one.hear(b"go\n", 1.0)
    assert len(one.written) == 1
    clock.now += TOLD_AGAIN
    one.hear(b"go\n", 1.0)
    assert len(one.written) == 2 and link.refused == 101
    one.hear(b"go elsewhere\n", 1.0)
    assert len(one.written) == 2
    clock.now += TOLD_ELSE
    one.hear(b"go elsewhere\n", 1.0)
    assert len(one.written) == 3


def test_what_stations_send_leaves_in_portions_and_no_more_of_it_waits_than_given():
    clock, sent = Clock(), []
    portions = Portions(sent.append, clock)
    frame = bytes(100)
    for _ in range(200):
        portions.add(frame)
    at_once = len(sent)
    assert at_once == BURST // 100 and portions.dropped == 200 - at_once - WAITING
    seconds = 0.8
    for _ in range(80):
        clock.now += seconds / 80
        portions.go()
    assert len(sent) - at_once <= RATE * seconds / 100 + 1
    assert len(sent) - at_once >= RATE * seconds / 100 - 2
    clock.now += 1000.0
    portions.go()
    assert len(sent) <= at_once + RATE * seconds / 100 + 1 + BURST // 100  # a rest saves up a burst


def test_a_station_that_cannot_be_opened_is_reported_before_the_board_is_spoken_to():
    link, board, (one, _), _ = shared(False, True)
    with pytest.raises(LinkError, match="nobody there"):
        link.start(lambda data, stamp: None)
    assert one.closed and not hasattr(board, "hear")
