"""The loopback with faults: each fault alone, the same for the same seed, and an honest account of
them.
"""

import threading

import pytest

from firmware_bridge.link import Faults, LoopbackWire, open_transport
from firmware_bridge.link.server import serve
from firmware_bridge.messages import ConfigError, LinkError

FRAMES = [b"%03d" % i + bytes(range(7)) for i in range(300)]


class Clock:
    def __init__(self):
        self.now = 100.0

    def __call__(self):
        return self.now


def drive(faults, seed=0, frames=FRAMES, clock=None, tick=0.0):
    """Send frames from bridge to board; returns the wire and the chunks that arrived."""
    clock = clock or Clock()
    wire = LoopbackWire(faults, seed, manual=True, clock=clock)
    got = []
    wire.board.start(lambda data, stamp: got.append(data))
    wire.bridge.start(lambda data, stamp: None)
    for frame in frames:
        wire.bridge.write(frame)
        clock.now += tick
        wire.pump()
    return wire, got


def test_no_faults_no_changes():
    wire, got = drive(Faults())
    assert got == FRAMES and wire.bridge.counters["faults"] == 0


def test_drop():
    wire, got = drive(Faults(drop=0.3))
    assert got == [frame for frame in FRAMES if frame in got]
    assert len(FRAMES) - len(got) == wire.bridge.counters["faults"] > 50


def test_duplicate():
    wire, got = drive(Faults(duplicate=0.3))
    assert len(got) - len(FRAMES) == wire.bridge.counters["faults"] > 50
    assert list(dict.fromkeys(got)) == FRAMES


def test_corrupt():
    wire, got = drive(Faults(corrupt=0.3))
    wrong = [(a, b) for a, b in zip(FRAMES, got, strict=True) if a != b]
    assert 50 < len(wrong) <= wire.bridge.counters["faults"]
    assert all(
        len(a) == len(b) and sum(x != y for x, y in zip(a, b, strict=True)) <= 3 for a, b in wrong
    )


def test_reorder():
    wire, got = drive(Faults(reorder=0.2))
    assert sorted(got) == FRAMES[: len(got)] or len(FRAMES) - len(got) == 1
    assert got != FRAMES and wire.bridge.counters["faults"] > 30
    assert all(abs(int(frame[:3]) - i) <= 1 for i, frame in enumerate(got))


def test_split():
    wire, got = drive(Faults(split=0.5))
    assert (
        b"".join(got) == b"".join(FRAMES)
        and len(got) > len(FRAMES)
        and wire.bridge.counters["faults"] > 100
    )


def test_delay_keeps_the_order():
    clock = Clock()
    wire = LoopbackWire(Faults(delay=0.05), 1, manual=True, clock=clock)
    got = []
    wire.board.start(lambda data, stamp: got.append((data, stamp)))
    wire.bridge.start(lambda data, stamp: None)
    for frame in FRAMES[:100]:
        wire.bridge.write(frame)
    wire.pump()
    assert len(got) < 100
    while len(got) < 100:
        clock.now += 0.001
        wire.pump()
    assert [data for data, _ in got] == FRAMES[:100] and 100.0 < got[-1][1] <= 100.051


def test_cut_in_the_middle_of_a_frame_and_back():
    clock = Clock()
    wire, got = drive(Faults(cut=0.02, cut_for=0.05), seed=3, clock=clock, tick=0.01)
    assert wire.cuts > 1 and wire.bridge.counters["refused_writes"] > 0
    assert any(0 < len(data) < len(FRAMES[0]) for data in got)
    clock.now += 1.0
    assert wire.bridge.connected and wire.bridge.counters["reconnects"] == wire.cuts
    wire.faults = Faults()
    assert wire.bridge.write(b"again")
    wire.pump()
    assert got[-1] == b"again"


def test_cut_and_heal_by_hand():
    wire, got = drive(Faults())
    wire.cut()
    assert not wire.bridge.connected and not wire.board.connected and not wire.bridge.write(b"x")
    wire.heal()
    assert wire.bridge.connected and wire.bridge.write(b"y")
    wire.pump()
    assert got[-1] == b"y" and wire.bridge.counters["reconnects"] == 1


def test_same_seed_same_faults():
    storm = Faults(
        drop=0.1, duplicate=0.1, corrupt=0.1, reorder=0.1, split=0.2, cut=0.01, delay=0.01
    )
    runs = [drive(storm, seed, clock=Clock(), tick=0.01)[1] for seed in (5, 5, 6)]
    assert runs[0] == runs[1] != runs[2]


def test_bounded():
    wire = LoopbackWire(Faults(delay=10.0), manual=True, clock=Clock())
    wire.board.start(lambda data, stamp: None)
    wire.bridge.start(lambda data, stamp: None)
    for frame in FRAMES * 10:
        wire.bridge.write(frame)
    assert wire.board.counters["dropped_frames"] == 3000 - 256


def test_a_callback_that_raises_cuts_for_a_moment():
    wire = LoopbackWire(manual=True, clock=Clock())

    def callback(data, stamp):
        raise RuntimeError("bug")

    wire.board.start(callback)
    wire.bridge.start(lambda data, stamp: None)
    wire.bridge.write(b"x")
    wire.pump()
    assert (
        wire.board.counters["errors"] == 1
        and not wire.board.connected
        and "bug" in wire.board.last_error
    )


def test_answers_in_the_callback_with_threads():
    wire = LoopbackWire()
    done = threading.Event()
    wire.board.start(lambda data, stamp: wire.board.write(data + b"!"))
    got = []
    wire.bridge.start(lambda data, stamp: (got.append(data), len(got) == 100 and done.set()))
    for i in range(100):
        wire.bridge.write(b"%d" % i)
    assert done.wait(5.0) and got == [b"%d!" % i for i in range(100)]
    wire.bridge.close()
    wire.board.close()


def test_ends_by_name():
    board = serve("loopback:by-name")
    board.start(lambda data, stamp: None)
    bridge = open_transport("loopback:by-name?drop=1&seed=4")
    bridge.start(lambda data, stamp: None)
    with pytest.raises(LinkError, match="in use"):
        open_transport("loopback:by-name")
    assert bridge.write(b"x") and bridge.counters["faults"] == 1
    bridge.close()
    again = open_transport("loopback:by-name")
    again.start(lambda data, stamp: None)
    assert again.connected
    again.close()
    board.close()


def test_bad_faults():
    with pytest.raises(ConfigError, match="corrupt: expected 0 to 1, got 1.5"):
        Faults(corrupt=1.5)
    with pytest.raises(ConfigError, match="delay: expected"):
        Faults(delay=float("nan"))
