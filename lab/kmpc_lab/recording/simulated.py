"""Records a simulated drive."""

from __future__ import annotations

import io
import math
import os
import time
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from firmware_bridge.live.channel import Packet
from firmware_bridge.live.feed import Feed, tell_links
from firmware_bridge.live.moment import LastStep, last_step, map_packet, plan_packet
from firmware_bridge.messages import speeds_of
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.schemas import Ended, PoseSeen, Record, Sent, Stepped, TruePose
from firmware_bridge.recording.drive.seen import counted, scan_among
from kmpc_lab.recording.drive_file import drive_of
from kmpc_lab.sim.closed_loop import Run
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.insight import insight
from kmpc_lite.control.plan import Plan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.files import write_whole
from kmpc_lite.learn.formats.mcap import DRIVE
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from firmware_bridge.live.address import LiveAddress
    from kmpc_lite.scenario.files import Scenario


def outcome_of(run: Run) -> dict[str, Any]:
    """Outcome of a run: what JSON can hold."""
    return {
        "outcome": run.outcome.value,
        "duration": run.duration,
        "clearance": run.clearance if math.isfinite(run.clearance) else None,
        "words": run.info.get("ended", ""),
    }


CHUNK = 0.5  # time that one chunk of the file holds [s]


class SimulationRecorder:
    """Watches the steps of a simulated drive: ``drive(..., watch=recorder)``.

    `controller`: that drives.
    """

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._records: list[Record] = []

    def __call__(self, time: float, pose: Array, obstacles: Any, plan: Plan) -> None:
        """Take in a step."""
        behind, scan = insight(self._controller, plan), scan_among(obstacles)
        x, y, theta = pose.tolist()
        self._records += (
            PoseSeen(time, (x, y, theta)),
            Stepped(
                time,
                (x, y, theta),
                plan,
                behind.path,
                behind.margins,
                circle_rows(obstacles),
                scan=None if scan is None else counted(self._controller, scan),
            ),
            Sent(time, speeds_of(plan.command)),
        )

    def content(self, run: Run) -> bytes:
        """Give the bytes of the recorded drive."""
        encoder = DriveEncoder(run.scenario, run.dt, {**run.info, "kind": "simulated"})
        every = run.dt * len(run.inputs) / (len(run.path) - 1)
        truth = [TruePose(k * every, tuple(pose)) for k, pose in enumerate(run.path.tolist())]
        records = sorted([*self._records, *truth], key=lambda record: record.time)
        parts: dict[int, list[Record]] = {}
        for record in records:
            parts.setdefault(int(record.time / CHUNK), []).append(record)
        pieces = [encoder.begin(0.0)]
        for part in parts.values():
            pieces += encoder.encode(part)
        return b"".join([*pieces, *encoder.encode([Ended(run.duration, outcome_of(run))])])

    def with_details(self, run: Run) -> Run:
        """Give the run with all that was recorded of it."""
        return replace(
            run, details=drive_of(io.BytesIO(self.content(run)), run.scenario.name).details
        )

    def write(self, folder: str | os.PathLike[str], run: Run) -> Path:
        """Write the recorded drive into a folder, which is made; whole or not at all.

        Raises ScenarioError if it cannot be written.
        """
        path = Path(folder) / DRIVE
        try:
            Path(folder).mkdir(parents=True, exist_ok=True)
            with write_whole(path) as file:
                file.write(self.content(run))
        except OSError as error:
            raise ScenarioError(
                f"{path}: cannot write the drive: {error.strerror or error}"
            ) from error
        return path


def circle_rows(obstacles: Any) -> Array:
    """Circles (M, 5) among obstacles as `Controller.step` takes them."""
    if isinstance(obstacles, np.ndarray):
        rows = np.asarray(obstacles, dtype=float)
        wide = np.zeros((len(rows), 5))
        wide[:, : rows.shape[1]] = rows
        return wide
    found = [row for row in obstacles if _is_row(row)]
    return np.array([[*row, 0.0, 0.0][:5] for row in found], dtype=float).reshape(-1, 5)


def _is_row(obstacle: Any) -> bool:
    """Whether an obstacle is a circle: `Circle`, or a row of numbers."""
    return isinstance(obstacle, Sequence | np.ndarray) and len(obstacle) in (3, 5)


RECENT = 200  # steps whose times are shown


class WatchedController:
    """Steps a controller at the pace of a clock, and brakes while a stop is pressed.

    It is what `kmpc_lab.drive` drives; a page asks it for `packet` from another thread.

    `controller`: plans. `clock`, `sleep`: [s]; for tests.
    """

    def __init__(
        self,
        controller: Controller,
        clock: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._controller, self._clock, self._sleep = controller, clock, sleep
        self.options = controller.options
        self._next: float | None = None
        self._steps = 0
        self._command = np.zeros(2)
        self._sent: Array | None = None  # what went to the robot instead of the last plan's command
        self._last: LastStep | None = None
        self._goal: tuple[float, ...] = (0.0, 0.0, 0.0)
        self._times: deque[float] = deque(maxlen=RECENT)
        self.period = controller.problem.dt  # [s]
        self.latched = False  # whether a stop is pressed
        self._enabled = True

    def hear(self, word: str) -> None:
        """Carry out a button of the page, as a bridge does: stop, reset or enable."""
        if word == "stop":
            self.latched, self._enabled = True, False
        elif word == "reset":
            self.latched = False
        elif word == "enable":
            self._enabled = not self.latched

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: Any = ()) -> Plan:
        """Plan, show it, and wait until the period begins."""
        controller, dt = self._controller, self._controller.problem.dt
        plan = controller.step(x, goal, obstacles, sent=self._sent)
        self._sent = None if self._enabled else self._braked(dt)
        command = plan.command if self._sent is None else self._sent
        plan = replace(plan, command=command)
        self._goal = tuple(np.asarray(goal, dtype=float).tolist())
        self._times.append(plan.timing["total"])
        self._command, self._steps = command, self._steps + 1
        self._last = last_step(controller, x, plan, scan_among(obstacles))
        self._wait(dt)
        return plan

    def packet(self) -> Packet:
        """Give what is true now, for a page."""
        step, command, latched = self._last, self._command, self.latched
        gate = "ESTOP" if latched else "ACTIVE" if self._enabled else "IDLE"
        shown: Packet = {
            "gate": gate,
            "gate_text": "",
            "latched": latched,
            "wrong": ["STOP is pressed: the simulated robot is held"] if latched else [],
            "link": {"text": "none: a simulation in real time"},
        }
        if step is None:
            return shown
        times = list(self._times)
        return {
            **shown,
            **plan_packet(step, self._goal),
            "pose": list(step.pose),
            "command": command.tolist(),
            "time": self._steps * self._controller.problem.dt,
            "step": {
                "p50": 1e3 * float(np.median(times)),
                "p99": 1e3 * float(np.quantile(times, 0.99)),
            },
        }

    def _braked(self, dt: float) -> Array:
        """Command of the coming period on the way to a standstill."""
        fall = np.asarray(self._controller.problem.deceleration, dtype=float) * dt
        slower: Array = self._command - np.clip(self._command, -fall, fall)
        return slower

    def _wait(self, dt: float) -> None:
        """Wait for the period's end; after a stall the pace begins anew."""
        now = self._clock()
        self._next = now + dt if self._next is None else max(self._next + dt, now)
        if self._next > now:
            self._sleep(self._next - now)


@contextmanager
def shown(
    watched: WatchedController, scenario: Scenario, page: LiveAddress | None
) -> Iterator[Callable[[str], None]]:
    """Show a simulated drive on a page while the context lasts.

    It gives what tells the page how the drive ended.
    """
    if page is None:
        yield lambda outcome: None
        return
    with Feed(page, "firmware_bridge.live", on_word=watched.hear) as feed:
        tell_links(feed.links)
        feed.start(watched.packet, map_packet(scenario, f"simulation of {scenario.name}"))

        def over(outcome: str) -> None:
            feed.say({**watched.packet(), "over": outcome})

        yield over
