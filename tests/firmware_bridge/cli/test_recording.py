"""What `kmpc run --record` writes, tick by tick, without a robot."""

from __future__ import annotations

import errno
import math
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import kmpc_lite as kl
from firmware_bridge.cli.recording import DriveRecorder, recorder_of, recording_to
from firmware_bridge.messages import ConfigError, LinkStatus, State
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import Action, GateState, Reason
from kmpc_lab import Outcome
from kmpc_lab.recording.drive_file import load_drive
from kmpc_lite.scenario.files import Scenario

STATUS = LinkStatus(
    connected=True,
    heartbeat_stamp=9.5,
    pose_stamp=-math.inf,
    ready=True,
    mode="GUIDED",
    counters={"frames": 7},
)
REPORT = {
    "outcome": "time is up",
    "ended": "time is up after 1.5 s, 0.30 m and 0.10 rad from the goal: board not heard",
    "why": ["board not heard"],
    "touched": False,
    "arrived_after_s": None,
    "duration_s": 1.5,
    "position_error_m": 0.3,
    "heading_error_rad": 0.1,
    "clearance_m": 0.2,
    "loop": {"commands_sent": 3, "commands_refused": 0},
}


def job() -> Any:
    scenario = Scenario.load("four_circles_1")
    controller = kl.Controller(kl.nominal_unicycle(0.1), scenario.problem())
    limits = SimpleNamespace(v_max=0.5, v_reverse=0.4, omega_max=1.0)
    robot = SimpleNamespace(
        gate=SimpleNamespace(limits=limits), link=SimpleNamespace(driver="vesc", url="pty:x")
    )
    return SimpleNamespace(
        scenario=scenario,
        controller=controller,
        period=0.1,
        robot=robot,
        watchers=[],
        navigator=SimpleNamespace(scan=None),
    )


def session() -> Any:
    return SimpleNamespace(loop=SimpleNamespace(snapshot=SimpleNamespace(status=STATUS)))


def drive(recorder: DriveRecorder, course: Any, seconds: float, begin: float) -> None:
    """Ticks of a robot that stands, and plans."""
    for k in range(int(seconds / 0.02)):
        now = begin + 0.02 * k
        state = State(0.01 * k, 0.0, 0.0, 0.5, 0.0, now - 0.01)
        lost = k > 30
        output = GateOutput(
            0.5,
            0.1,
            Action.SEND,
            GateState.STOPPING if lost else GateState.ACTIVE,
            (Reason.HEARTBEAT,) if lost else (),
        )
        recorder.on_tick(now, state, output, sent=k % 2 == 0, fresh=False)
        if k % 5 == 0:
            plan = course.controller.step((0.01 * k, 0.0, 0.0), course.scenario.goal)
            course.watchers[0]((0.01 * k, 0.0, 0.0), plan)
            recorder.planned()
            recorder.planned()  # once is enough


def test_a_drive_is_recorded_as_it_happened(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    course, clock = job(), [10.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    monkeypatch.setattr("time.time", lambda: 1.7e9)
    recorder = recorder_of(course, "kmpc run --x <script>")(session(), tmp_path / "drive")
    for k in range(50):
        clock[0] = 10.0 + 0.02 * k
        drive(recorder, course, 0.02, clock[0])
    recorder.finish(REPORT)
    recorder.close()
    assert recorder.file.problem == ""
    run = load_drive(tmp_path)
    details = run.details
    assert details is not None and run.outcome is Outcome.TIMEOUT and run.duration == 1.5
    assert run.info["ended"] == REPORT["ended"]
    assert (run.position_error, run.heading_error) == (0.3, 0.1)
    assert run.info["u_min"] == [-0.4, -1.0] and run.info["command"] == "kmpc run --x <script>"
    assert len(details.times) == 50 and len(details.sent) == 50 and len(details.measured) == 50
    assert details.health[0][1]["mode"] == "GUIDED" and details.health[0][1]["pose_ago"] is None
    assert details.health[0][1]["heard_ago"] == pytest.approx(0.5)


def test_what_the_gate_does_is_told_when_it_changes(tmp_path: Path) -> None:
    course = job()
    recorder = recorder_of(course, "")(session(), tmp_path / "drive")
    drive(recorder, course, 1.0, 100.0)
    recorder.finish({**REPORT, "touched": True})
    recorder.close()
    run = load_drive(tmp_path)
    assert run.details is not None and run.outcome is Outcome.COLLISION
    assert [(state, why) for _, state, why in run.details.gates] == [
        ("ACTIVE", ()),
        ("STOPPING", ("board not heard",)),
    ]


def test_a_drive_that_was_cut_off_is_there_up_to_the_last_moment(tmp_path: Path) -> None:
    course = job()
    recorder = recorder_of(course, "")(session(), tmp_path / "drive")
    drive(recorder, course, 1.0, 100.0)
    recorder.file.close()  # as far as the disk has it; nothing told how it ended
    run = load_drive(tmp_path)
    assert run.info["ended"] == "the recording breaks off"
    assert run.details is not None and len(run.details.times) == 10


def test_a_full_disk_is_told_and_what_was_written_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    course, room, write = job(), [60_000], os.write

    def full(descriptor: int, data: Any) -> int:
        if recorder is None or descriptor != recorder.file._descriptor:
            return write(descriptor, data)
        if room[0] <= 0:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
        done = write(descriptor, bytes(data)[: room[0]])
        room[0] -= done
        return done

    recorder: DriveRecorder | None = None
    recorder = recorder_of(course, "")(session(), tmp_path / "drive")
    monkeypatch.setattr("os.write", full)
    for k in range(6):
        drive(recorder, course, 0.5, 100.0 + k)
        recorder.file._take([recorder.file._queue.popleft() for _ in recorder.file._queue.copy()])
    recorder.finish(REPORT)
    recorder.close()
    assert "No space left" in recorder.file.problem and "lost" in recorder.file.problem
    run = load_drive(tmp_path)
    assert run.details is not None and run.info["ended"] == "the recording breaks off"


def test_a_folder_is_made_and_not_left_empty(tmp_path: Path) -> None:
    with recording_to(tmp_path / "a" / "b") as name:
        assert name == str(tmp_path / "a" / "b" / "drive")
    assert not (tmp_path / "a" / "b").exists()
    with recording_to(tmp_path / "a" / "b") as name:
        Path(f"{name}.csv").write_text("t\n")
    assert (tmp_path / "a" / "b" / "drive.csv").exists()
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="--record .*file"), recording_to(tmp_path / "file"):
        pass
    with recording_to(None) as name:
        assert name is None
