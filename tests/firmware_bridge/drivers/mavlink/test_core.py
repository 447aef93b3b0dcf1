"""The driver against the emulated rover, on a clock of the tests' own."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest
from mavlink_rig import Rig, dialect, error, other

from firmware_bridge.drivers.mavlink.options import MavlinkOptions
from firmware_bridge.drivers.mavlink.telemetry import StatusTexts


@pytest.mark.parametrize(
    ("theta", "v", "omega"),
    [
        (0.0, 0.5, 0.3),
        (1.0, -0.4, 0.3),
        (-2.5, 0.5, -0.3),
        (math.pi, 0.0, 0.5),
        (math.pi, -0.4, 0.3),
    ],
)
def test_what_we_command_is_what_moves_and_what_we_see(theta: float, v: float, omega: float):
    rig = Rig(pose=(1.0, -2.0, theta))
    rig.take()
    rig.drive(v, omega, 4.0)
    state = rig.core.state
    assert state is not None
    assert state.v == pytest.approx(v, abs=0.02)
    assert state.omega == pytest.approx(omega, abs=0.02)
    assert -math.pi < state.theta <= math.pi
    distance, angle = error(rig)
    assert distance < 0.012 * abs(v) + 1e-3
    assert angle < 0.012 * abs(omega) + 1e-3
    east, north, turn = rig.rover.velocity
    heading = rig.rover.pose[2]
    assert (east * math.cos(heading) + north * math.sin(heading), turn) == pytest.approx(
        (v, omega), abs=0.02
    )


def test_time_boot_ms_wraps_while_driving() -> None:
    rig = Rig(uptime=2**32 / 1000.0 - 8.0)
    rig.take()
    ages = []
    rig.run(
        10.0,
        lambda: (
            rig.core.set_point(0.3, 0.0, rig.now),
            ages.append(rig.now - rig.core.state.stamp),
        ),
    )  # type: ignore[union-attr]
    assert rig.rover._telemetry.boot_ms < 10_000
    assert max(ages) < 0.1
    assert rig.core.counters["clock_jumps"] == 0


def test_heartbeats_go_out_once_a_second_after_an_eager_beginning() -> None:
    rig = Rig()
    rig.run(2.0)
    eager = len([f for _, f in rig.sent if f[7:10] == b"\0\0\0"])
    assert 4 <= eager <= 15, "ten a second until one was accepted"
    rig.sent.clear()
    rig.run(20.0)
    parser = dialect.MAVLink(None)
    beats = [
        m for m in (parser.decode(bytearray(f)) for _, f in rig.sent) if m.get_type() == "HEARTBEAT"
    ]
    assert 19 <= len(beats) <= 21
    assert {(m.type, m.autopilot, m.get_srcSystem(), m.get_srcComponent()) for m in beats} == {
        (6, 8, 255, 190)
    }
    companion = Rig(MavlinkOptions(role="companion"))
    companion.run(1.0)
    first = parser.decode(bytearray(companion.sent[0][1]))
    assert (first.type, first.get_srcSystem(), first.get_srcComponent()) == (18, 1, 191)


def test_the_gcs_failsafe_is_turned_on_and_then_stops_a_rover_that_hears_nothing() -> None:
    rig = Rig()
    rig.take()
    assert rig.core.failsafe.note == "GCS failsafe: on, watches us"
    assert rig.rover.parameters["FS_GCS_ENABLE"] == 1.0
    rig.drive(0.4, 0.0, 2.0)
    rig.to_rover = lambda frame: []
    rig.run(3.5)
    assert rig.rover.mode == "GUIDED"
    rig.run(4.0)
    assert rig.rover.mode == "HOLD"


@pytest.mark.parametrize(
    ("options", "parameters", "note"),
    [
        (MavlinkOptions(failsafe=False), {}, "GCS failsafe: off (FS_GCS_ENABLE 0)"),
        (
            MavlinkOptions(role="companion"),
            {},
            "GCS failsafe: watches system 255 (SYSID_MYGCS), not us (1)",
        ),
        (
            MavlinkOptions(),
            {"SYSID_MYGCS": 254.0},
            "GCS failsafe: watches system 254 (SYSID_MYGCS), not us (255)",
        ),
    ],
)
def test_what_the_gcs_failsafe_does_not_cover_is_said(
    options: MavlinkOptions, parameters: dict[str, float], note: str
) -> None:
    rig = Rig(options, parameters=parameters)
    rig.run(5.0)
    assert rig.core.failsafe.note.startswith(note)
    assert rig.rover.parameters["FS_GCS_ENABLE"] == float(options.failsafe)


def test_parameters_that_never_come_are_not_asked_for_ever() -> None:
    rig = Rig()
    rig.to_core = lambda frame: [] if frame[7] == 22 else [frame]
    rig.run(40.0)
    parser = dialect.MAVLink(None)
    asked = [
        m
        for m in (parser.decode(bytearray(f)) for _, f in rig.sent)
        if m.get_type() == "PARAM_REQUEST_READ"
    ]
    assert len(asked) == 12
    assert rig.core.failsafe.note.endswith("no answer")


class TestOthers:
    """Only the configured system and component are obeyed."""

    def rig(self) -> Rig:
        rig = Rig()
        rig.take()
        rig.drive(0.3, 0.0, 1.0)
        return rig

    @pytest.mark.parametrize(("system", "component"), [(2, 1), (1, 100), (255, 190)])
    def test_others_are_counted_and_ignored(self, system: int, component: int) -> None:
        rig = self.rig()
        stranger, before = other(system, component), rig.core.state
        for message in (
            dialect.MAVLink_heartbeat_message(10, 3, 1, 0, 4, 3),
            dialect.MAVLink_local_position_ned_message(5000, 9.0, 9.0, 0.0, 0.0, 0.0, 0.0),
            dialect.MAVLink_ekf_status_report_message(0, 0.0, 0.0, 0.0, 0.0, 0.0),
            dialect.MAVLink_command_ack_message(176, 0),
            dialect.MAVLink_timesync_message(5, 5),
        ):
            rig.core.receive(stranger.encode(message), rig.now)
        assert rig.core.counters["others"] == 5
        assert rig.core.state is before
        assert rig.ready
        assert rig.faults == ()

    def test_another_master_is_a_fault(self) -> None:
        rig = self.rig()
        theirs = dialect.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 8, 0x5C7, *[0.0] * 11
        )
        rig.core.receive(other(254, 191).encode(theirs), rig.now)
        assert rig.faults == ("another master: system 254 sends set-points to the vehicle",)
        assert rig.core.counters["other_masters"] == 1
        rig.run(1.1)
        assert rig.faults == ()

    @pytest.mark.parametrize(("autopilot", "kind"), [(12, 10), (3, 2), (8, 6)])
    def test_what_is_no_ardupilot_rover_is_not_driven(self, autopilot: int, kind: int) -> None:
        rig = Rig()
        rig.core.receive(
            other(1).encode(dialect.MAVLink_heartbeat_message(kind, autopilot, 0x81, 15, 4, 3)),
            rig.now,
        )
        rig.core.tick(rig.now)
        rig.core.set_point(0.5, 0.0, rig.now)
        assert rig.core.counters["held_back"] == 1
        assert len(rig.sent) == 1, "our heartbeat only"
        assert f"autopilot {autopilot}, type {kind}" in rig.core.wrong_vehicle


@pytest.mark.parametrize(
    ("v", "omega"), [(math.nan, 0.0), (0.0, math.nan), (math.inf, 0.0), (0.0, -math.inf)]
)
def test_what_is_not_finite_never_reaches_the_wire(v: float, omega: float) -> None:
    rig = Rig()
    rig.take()
    before = len(rig.sent)
    with pytest.raises(ValueError, match="finite"):
        rig.core.set_point(v, omega, rig.now)
    assert len(rig.sent) == before


def reboot(rig: Rig, east: float) -> None:
    """Restart the rover as the real one does: its origin is where it stands then."""
    x, y, theta = rig.rover.pose
    rig.rover._boot(0.0)
    rig.rover.place(x - east, y, theta)


def test_a_restart_is_reported_and_stays_reported() -> None:
    rig = Rig()
    rig.take()
    rig.drive(0.3, 0.0, 2.0)
    assert rig.core.status(rig.now, True).frame_doubt == ""
    reboot(rig, 3.0)
    rig.run(5.0)
    assert "was restarted" in rig.core.status(rig.now, True).frame_doubt
    rig.core.take(rig.now)
    rig.run(20.0)
    assert "was restarted" in rig.core.status(rig.now, True).frame_doubt
    rig.core.confirm_frame()
    rig.run(5.0)
    assert rig.core.status(rig.now, True).frame_doubt == ""
    assert rig.core.counters["frame_doubts"] == 1


def test_an_origin_that_another_station_moves_is_reported() -> None:
    rig = Rig()
    rig.take()
    rig.run(3.0)
    latitude, longitude, altitude = rig.rover.autopilot.estimator.origin
    rig.rover.autopilot.estimator.origin = (latitude + 1e-5, longitude, altitude)
    rig.until(lambda: "origin has moved" in rig.core.status(rig.now, True).frame_doubt, 3.0)


LONG = "Battery 1 below minimum arming voltage and the compass is not calibrated, calibrate it"


def chunk(text: str, number: int = 0, sequence: int = 0) -> SimpleNamespace:
    return SimpleNamespace(severity=4, text=text, id=number, chunk_seq=sequence)


def test_a_long_refusal_is_reported_whole_in_the_autopilots_own_words() -> None:
    """The firmware sends it in chunks of 50; it was cut, and the reason with it."""
    rig = Rig()
    rig.run(4.0)
    rig.rover.autopilot.arming_failure = LONG
    rig.core.take(rig.now)
    rig.run(3.0)
    assert f"arming is refused for now: Arm: {LONG}" in rig.faults
    rig.rover.autopilot.arming_failure = ""
    rig.until(lambda: rig.ready, 5.0)
    assert rig.core.refusals(rig.now) == ()


def test_chunks_in_any_order_and_texts_of_whole_chunks() -> None:
    words = StatusTexts()
    assert words.on_text(chunk("b" * 50, 7, 1), 0.0) == ""
    assert words.on_text(chunk("", 7, 2), 0.1) == ""
    assert words.on_text(chunk("a" * 50, 7, 0), 0.2) == "a" * 50 + "b" * 50
    assert words.on_text(chunk("short"), 0.3) == "short"


def test_a_lost_chunk_leaves_a_gap_and_not_silence() -> None:
    words = StatusTexts()
    words.on_text(chunk("a" * 50, 7, 0), 0.0)
    words.on_text(chunk("the end", 7, 2), 0.1)
    words.tick(2.0)
    assert words.texts[-1][1] == "a" * 50 + " ... " + "the end"
