"""`kmpc run --record`: a real drive as MCAP, with what the controller had in mind."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from firmware_bridge.messages import ConfigError

if TYPE_CHECKING:
    from firmware_bridge.integration.course import Course
    from firmware_bridge.messages import LinkStatus, State
    from firmware_bridge.recording.durable import DurableFile
    from firmware_bridge.robot_file import Robot
    from firmware_bridge.runtime.session import Session
    from firmware_bridge.safety.gate import GateOutput

NAME = "drive"  # of the files in a drive's folder, without their endings
STAMPS = 16  # poses that may come while the controller plans
HEALTH_PERIOD = 1.0  # time between two looks at link and vehicle [s]


@contextmanager
def recording_to(folder: Path | None) -> Iterator[str | None]:
    """Make a folder for a drive, and give the name of its files; leave nothing empty behind.

    Raises ConfigError if it cannot be made.
    """
    if folder is None:
        yield None
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"--record {folder}: {error.strerror or error}") from error
    try:
        yield str(folder / NAME)
    finally:
        with suppress(OSError):  # it holds something
            folder.rmdir()


def recorder_of(job: Course, command: str) -> Callable[[Session, Path], DriveRecorder]:
    """Give what records a course, once there is a session."""

    def make(session: Session, name: Path) -> DriveRecorder:
        from firmware_bridge.recording.drive.encoder import DriveEncoder
        from firmware_bridge.recording.durable import DurableFile

        now, path = time.monotonic(), name.with_name(f"{name.name}.mcap")
        link = job.robot.link
        plant = f"{link.driver} over {link.url}; poses as they came through the link"
        about = about_drive(job.robot, plant, job.controller, command)
        encoder = DriveEncoder(job.scenario, job.period, about, offset=time.time() - now)
        return DriveRecorder(DurableFile(path, encoder.encode, encoder.begin(now)), job, session)

    return make


class DriveRecorder:
    """Records a drive; an `Observer` of the loop, and receives each plan.

    Both threads only put plain data into a queue: the file's own thread encodes and writes.

    `file`: a new .mcap file, which encodes what it is given. `job`: what is driven; its watchers
    get this one too. `session`: whose loop knows the health of the link.
    """

    def __init__(self, file: DurableFile[Any], job: Any, session: Session) -> None:
        from kmpc_lite.control.insight import insight

        self._job, self._session, self._insight = job, session, insight
        self._file = file
        self._looked = -1.0
        self._stamps: deque[float] = deque([-1.0], maxlen=STAMPS)
        self._gate: tuple[Any, Any] = (None, ())
        self._plan: tuple[Any, ...] | None = None
        """Of the planner's thread: the plan that is still to be looked at."""
        job.watchers.append(self.saw)

    @property
    def file(self) -> DurableFile[Any]:
        """Where to."""
        return self._file

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in one tick of the loop."""
        from firmware_bridge.recording.drive.schemas import Gate, Health, PoseSeen, Sent

        if state is not None and state.stamp > self._stamps[-1]:
            self._stamps.append(state.stamp)
            self._file.put(PoseSeen(state.stamp, (state.x, state.y, state.theta)))
        if sent:
            self._file.put(Sent(now, output.speeds))
        if (gate := (output.state, output.reasons)) != self._gate:
            self._gate = gate
            self._file.put(Gate(now, output.state.name, tuple(r.value for r in output.reasons)))
        shot = self._session.loop.snapshot
        if shot is not None and now - self._looked >= HEALTH_PERIOD:
            self._looked = now
            self._file.put(Health(now, _health(shot.status, now)))

    def saw(self, pose: tuple[float, float, float], plan: Any, scan: Any) -> None:
        """Take in a plan, in the thread that has just made it."""
        began = time.monotonic() - plan.timing["total"]
        known = [stamp for stamp in tuple(self._stamps) if 0.0 < stamp <= began]
        age = began - known[-1] if known else None
        self._plan = began, pose, plan, age, scan

    def planned(self) -> None:
        """Look behind the plan, in the same thread, once its command is on its way."""
        from firmware_bridge.recording.drive.schemas import Stepped
        from firmware_bridge.recording.drive.seen import counted

        if self._plan is None:
            return
        (began, pose, plan, age, scan), self._plan = self._plan, None
        if scan is not None:
            scan = counted(self._job.controller, scan)
        behind = self._insight(self._job.controller, plan)
        circles = plan.around.circles
        self._file.put(Stepped(began, pose, plan, behind.path, behind.margins, circles, age, scan))

    def finish(self, report: dict[str, Any]) -> None:
        """Note how the drive ended."""
        from firmware_bridge.recording.drive.schemas import Ended

        outcome = "timeout" if report["arrived_after_s"] is None else "reached"
        errors = report["position_error_m"], report["heading_error_rad"]
        told = {
            "outcome": "collision" if report["touched"] else outcome,
            "duration": report["duration_s"],
            "clearance": report["clearance_m"],
            "errors": None if None in errors else errors,
        }
        loop = {key: report["loop"][key] for key in ("commands_sent", "commands_refused")}
        self._file.put(Ended(time.monotonic(), {**told, "words": report["ended"], **loop}))

    def close(self) -> None:
        """Write what waits, and close; idempotent."""
        self._file.close()


def about_drive(robot: Robot, plant: str, controller: Any, command: str) -> dict[str, Any]:
    """What to keep with a drive of a plant described in words."""
    limits = robot.gate.limits
    return {
        "kind": "driven",
        "plant": plant,
        "model": controller.model.info.get("method", ""),
        "u_min": [-limits.v_reverse, -limits.omega_max],
        "u_max": [limits.v_max, limits.omega_max],
        "command": command,
    }


def _health(status: LinkStatus, now: float) -> dict[str, Any]:
    """State of link and vehicle as values that JSON can hold."""
    return {
        "connected": status.connected,
        "ready": status.ready,
        "armed": status.armed,
        "pose_ok": status.pose_ok,
        "mode": status.mode,
        "faults": list(status.faults),
        "heard_ago": now - status.heartbeat_stamp,
        "pose_ago": now - status.pose_stamp,
        "counters": dict(status.counters),
    }
