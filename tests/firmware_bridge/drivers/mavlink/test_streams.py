"""Telemetry that another station lowers is asked for again, and reported."""

from mavlink_rig import Rig, dialect, other

from firmware_bridge.drivers.mavlink.commands import CommandDesk
from firmware_bridge.drivers.mavlink.streams import Stream, StreamRequests

ALL, MAVPROXY_RATE = 0, 4  # what MAVProxy asks for every 15 s at its default settings [Hz]


def lower(rig: Rig) -> None:
    """Ask for all streams at 4 Hz, as MAVProxy does over the same port."""
    message = dialect.MAVLink_request_data_stream_message(1, 1, ALL, MAVPROXY_RATE, 1)
    rig.rover.receive(other(255, 230).encode(message), rig.now)


def gaps_while(rig: Rig, seconds: float) -> float:
    """Let time pass; the longest time without a newer pose [s]."""
    longest, last, since = 0.0, rig.core.state, rig.now

    def look() -> None:
        nonlocal longest, last, since
        if rig.core.state is not last:
            last, since = rig.core.state, rig.now
        longest = max(longest, rig.now - since)
        rig.core.set_point(0.3, 0.0, rig.now)

    rig.run(seconds, look, 0.01)
    return longest


def test_a_station_that_lowers_the_streams_costs_one_short_gap() -> None:
    """Poses came four times a second for ever: stop and go, and once out of the fence."""
    rig = Rig()
    rig.take()
    rig.run(2.0)
    for _ in range(3):
        lower(rig)
        assert gaps_while(rig, 15.0) < 0.25
        assert rig.core.streams.streams[0].measured(rig.now) > 35.0
    assert rig.ready
    assert rig.core.counters["streams_lowered"] >= 3
    lower(rig)
    rig.run(1.0)
    note = next(note for note in rig.core.notes(rig.now) if "LOCAL_POSITION_NED" in note)
    assert "40 Hz was asked for" in note
    assert "--streamrate -1" in note
    assert rig.core.warnings(rig.now) and "--streamrate -1" in rig.core.warnings(rig.now)[0]
    rig.run(15.0)
    assert not any("LOCAL_POSITION_NED" in note for note in rig.core.notes(rig.now))


def test_one_stall_is_reported_as_such_and_blamed_on_no_station() -> None:
    """It was reported as: "comes at 40 Hz, 40 Hz was asked for: another station lowers it"."""
    stream = Stream(32, "LOCAL_POSITION_NED", (40.0,), answered=True)
    requests, now = StreamRequests(CommandDesk(lambda *_: None), (stream,)), 0.0

    def comes(seconds: float, rate: float) -> None:
        nonlocal now
        for _ in range(round(seconds * rate)):
            now += 1.0 / rate
            stream.saw(now)
            if stream.ask_again(now):
                stream.asked = now

    comes(3.0, 40.0)
    now += 0.135
    assert stream.ask_again(now)
    comes(0.5, 40.0)
    note = requests.notes(now)[0]
    assert note.startswith("LOCAL_POSITION_NED paused for 0.16 s, and comes at 3")
    assert note.endswith("Hz again: the link or the vehicle stalled")
    assert requests.warning(now) == ""
    comes(3.0, 10.0)
    assert "1 Hz, 40 Hz was asked for: another station" in requests.notes(now)[0]
    assert "another station" in requests.warning(now)


def test_other_stations_are_reported_and_whose_heartbeats_the_failsafe_counts() -> None:
    rig = Rig()
    rig.take()
    beat = dialect.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)
    for system in (255, 77):
        rig.core.receive(other(system, 230).encode(beat), rig.now)
    notes = [n for n in rig.core.notes(rig.now) if "another ground station" in n]
    assert len(notes) == 2
    assert "only the 3 s set-point time-out" in notes[1]
    assert "failsafe" not in notes[0]
    rig.run(6.0)
    assert not any("another ground station" in note for note in rig.core.notes(rig.now))
