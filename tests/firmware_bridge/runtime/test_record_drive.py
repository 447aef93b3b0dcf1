"""A recording ends when its time is up, when all is covered, or with a word on what went wrong."""

from types import SimpleNamespace

import pytest

from firmware_bridge.cli.record import coverage_meter
from firmware_bridge.messages import ConfigError, State
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.observer import Change
from firmware_bridge.runtime.record_drive import RandomDriving, Recording
from firmware_bridge.safety.gate_table import GateState
from tests.helpers.simulated_robot import Simulated

LINK = {"driver": "roboclaw", "url": "pty:none"}
BOX = [-2.0, -2.0, 2.0, 2.0]


def robot(fence=BOX, **limits):
    safety = {} if fence is None else {"geofence": fence}
    return load_robot(None, {"link": LINK, "safety": safety, "limits": limits})


def recording(driving=None, seconds=300.0, wait=None, **limits):
    clock = SimpleNamespace(now=0.0)
    meter = coverage_meter(0.1)
    job = Recording(
        robot(**limits),
        seconds,
        0.1,
        driving or RandomDriving(),
        meter,
        clock=lambda: clock.now,
        wait=wait,
    )
    return job, clock


def session(state=GateState.ACTIVE):
    stops = []
    loop = SimpleNamespace(stop_reason="", request_stop=stops.append, changes=[], stops=stops)
    gate = SimpleNamespace(state=state)
    return SimpleNamespace(gate=gate, loop=loop, why=lambda: ["Arm: no GPS", "board not ready"])


def drive(job, clock, simulated, seconds, at=None):
    """Drive a simulated robot until the recording is over; what the session saw."""
    seen = at or session()
    simulated.watch = job.watch

    def control(state):
        clock.now = state.stamp
        if job.finished(seen) or seen.loop.stops:
            raise StopIteration
        return job.control(state)

    try:
        simulated.drive(control, seconds)
        job.finished(seen)
    except StopIteration:
        pass
    return seen


@pytest.mark.parametrize("wait", [None, 5.0])
def test_a_vehicle_that_is_never_given_ends_the_recording_with_the_reasons(wait):
    """It waited for ever, and said nothing."""
    job, clock = recording(seconds=20.0, wait=wait)
    patience, waiting = wait or 20.0, session(GateState.WAITING)
    assert job.outcome == "never drove" and job.summary() == ["never drove"]
    for clock.now in (100.0, 100.0 + patience):
        assert not job.finished(waiting) and waiting.loop.stops == []
    clock.now += 0.1
    assert not job.finished(waiting)
    told = f"never drove within {patience:g} s: Arm: no GPS; board not ready"
    assert waiting.loop.stops == [told] and job.outcome == f"stopped: {told}"
    assert job.summary() == [f"stopped: {told}"]


def test_until_covered_ends_as_soon_as_the_log_shows_all():
    job, clock = recording(RandomDriving(until_covered=True))
    simulated = Simulated(robot().gate.limits)
    seen = drive(job, clock, simulated, 290.0)
    assert seen.loop.stops == [] and job.outcome == "covered"
    assert 59.0 < simulated.state.stamp < 200.0
    assert job.report()["coverage"]["complete"] and job.summary() == [
        "the log shows all that a model needs"
    ]
    assert 0.1 <= job.report()["delay_s"] <= 0.5


def test_a_robot_that_goes_the_other_way_is_stopped_with_the_reason():
    job, clock = recording()
    seen = drive(job, clock, Simulated(robot().gate.limits, gains=(-1.0, 1.0)), 60.0)
    assert len(seen.loop.stops) == 1 and "it goes back" in seen.loop.stops[0]
    assert job.outcome == f"stopped: {seen.loop.stops[0]}" == job.summary()[0]


def test_a_robot_that_was_given_back_for_a_fault_ends_the_recording_with_that_fault():
    job, _ = recording()
    assert not job.finished(session())
    gone = session(GateState.RELEASED)
    gone.loop.changes = [
        Change(1.0, GateState.ACTIVE, GateState.STOPPING, ("outside the geofence",)),
        Change(2.0, GateState.HOLDING, GateState.RELEASED, ()),
    ]
    assert not job.finished(gone)
    assert gone.loop.stops == ["the robot was given back: outside the geofence"]


def test_what_is_missing_is_reported_with_how_it_is_recorded():
    job, clock = recording(seconds=20.0)
    drive(job, clock, Simulated(robot().gate.limits), 25.0)
    missing = job.report()["coverage"]["missing"]
    assert any(line.startswith("length: ") for line in missing) and len(missing) > 2
    assert any("give both logs to kmpc fit" in line for line in job.summary())
    assert all(len(line) < 130 for line in job.lines()) and "length         ###" in job.lines()[0]


def test_random_driving_without_a_fence_is_refused():
    with pytest.raises(ConfigError, match="geofence: missing"):
        Recording(robot(fence=None), 10.0, 0.1, RandomDriving(), None)
    assert (
        Recording(robot(fence=None), 10.0, 0.1, None, None)
        .control(State(0.0, 0.0, 0.0, 0.0, 0.0, 1.0))
        .v
        == 0.0
    )
