"""Records a simulated drive."""

from __future__ import annotations

import io
import math
import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from firmware_bridge.messages import speeds_of
from firmware_bridge.recording.drive.encoder import DriveEncoder
from firmware_bridge.recording.drive.records import Ended, PoseSeen, Record, Sent, Stepped, TruePose
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


def outcome_of(run: Run) -> dict[str, Any]:
    """Outcome of a run: what JSON can hold."""
    return {
        "outcome": run.outcome.value,
        "duration": run.duration,
        "clearance": run.clearance if math.isfinite(run.clearance) else None,
        "words": run.info.get("ended", ""),
    }


CHUNK = 0.5
"""Time that one chunk of the file holds [s]."""


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
