"""Makes the pieces of a recorded drive's MCAP file from records, in the thread that writes them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from functools import singledispatchmethod
from typing import Any

import numpy as np

from firmware_bridge.recording.drive import foxglove
from firmware_bridge.recording.drive.foxglove import stamp
from firmware_bridge.recording.drive.mcap_writer import McapWriter, Message
from firmware_bridge.recording.drive.records import (
    Ended,
    Gate,
    Health,
    Note,
    PoseSeen,
    Record,
    Sent,
    Stepped,
    TruePose,
)
from firmware_bridge.recording.drive.scene import map_scene, step_scene
from firmware_bridge.recording.drive.schemas import TOPICS
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

FORMAT, VERSION = "kmpc.drive", "1"
BEGIN, END = "kmpc.drive", "kmpc.outcome"
"""Names of the texts at the beginning and at the end of a file."""
STAGES = 25
"""So many stages of a plan are recorded at the most: every so manieth of a longer one."""
POINTS = 100
"""So many points of a path."""
SCENE_PERIOD = 0.2
"""Time between two scenes, which are for eyes alone [s]."""


class DriveEncoder:
    """Records to the bytes of a file; whoever writes these keeps their order.

    Parameters
    ----------
    scenario : Scenario
        What is driven.
    dt : float
        Period of the controller [s].
    about : dict
        What else to keep with the drive; what JSON can hold.
    offset : float
        What is added to the times of records, so that they are those of the wall [s].
    """

    def __init__(
        self, scenario: Scenario, dt: float, about: dict[str, Any], offset: float = 0.0
    ) -> None:
        self._scenario, self._dt, self._about, self._offset = scenario, dt, about, offset
        self._writer = McapWriter(TOPICS)
        self._path = self._circles = np.empty((0, 0))
        self._status, self._scene_time = "", -math.inf

    def begin(self, time: float) -> bytes:
        """Give the beginning of the file: what is driven, where."""
        told = {
            "name": self._scenario.name,
            "scenario": self._scenario.to_toml(),
            "dt": self._dt,
            "start": time,
            "about": self._about,
        }
        texts = {"format": FORMAT, "version": VERSION, "drive": _json(told)}
        shown = self.map_message(time)
        return (
            self._writer.begin("kmpc-lite")
            + self._writer.metadata(BEGIN, texts)
            + self._writer.chunk([shown])
        )

    def map_message(self, time: float) -> Message:
        """Show what stays, for viewers and files."""
        now = self._nanoseconds(time)
        return Message("/map", now, map_scene(now, self._scenario))

    def messages(self, record: Record) -> list[Message]:
        """Give the messages of one record, as viewers get them."""
        return list(self._messages(record, self._nanoseconds(record.time)))

    def encode(self, records: Iterable[Record]) -> list[bytes]:
        """Give the pieces of records; each can be read by itself."""
        messages: list[Message] = []
        ended: Ended | None = None
        for record in records:
            if isinstance(record, Ended):
                ended = record
            else:
                messages += self.messages(record)
        pieces = [self._writer.chunk(messages)]
        if ended is not None:
            told = {**ended.outcome, "end": ended.time}
            pieces.append(self._writer.metadata(END, {"outcome": _json(told)}) + self._writer.end())
        return list(filter(None, pieces))

    def _nanoseconds(self, time: float) -> int:
        return max(0, round(1e9 * (time + self._offset)))

    @singledispatchmethod
    def _messages(self, record: Any, now: int) -> Iterator[Message]:
        raise TypeError(f"nothing is recorded of {record!r:.60}")

    @_messages.register
    def _(self, record: PoseSeen, now: int) -> Iterator[Message]:
        if all(map(math.isfinite, record.pose)):
            yield Message("/pose", now, foxglove.pose_in_frame(now, record.pose))
            yield Message("/tf", now, foxglove.transform(now, record.pose))

    @_messages.register
    def _(self, record: TruePose, now: int) -> Iterator[Message]:
        yield Message("/truth", now, foxglove.pose_in_frame(now, record.pose))

    @_messages.register
    def _(self, record: Sent, now: int) -> Iterator[Message]:
        told = dict(zip(("v", "omega", "vy"), (round(s, 6) for s in record.command), strict=True))
        yield Message("/command", now, {"timestamp": stamp(now), **told})

    @_messages.register
    def _(self, record: Gate, now: int) -> Iterator[Message]:
        reasons = list(record.reasons)
        told = {"timestamp": stamp(now), "state": record.state, "reasons": reasons}
        yield Message("/gate", now, told)
        words = f"gate {record.state.lower()}" + (f": {', '.join(reasons)}" if reasons else "")
        yield Message("/log", now, foxglove.log(now, words, bool(reasons)))

    @_messages.register
    def _(self, record: Health, now: int) -> Iterator[Message]:
        yield Message("/health", now, {**_plain(record.values), "timestamp": stamp(now)})

    @_messages.register
    def _(self, record: Note, now: int) -> Iterator[Message]:
        yield Message("/log", now, foxglove.log(now, record.text, record.bad))

    @_messages.register
    def _(self, record: Stepped, now: int) -> Iterator[Message]:
        plan, stride = record.plan, -(-(len(record.plan.states) - 1) // STAGES)
        yield Message("/step", now, self._step(record, now, stride))
        states = _finite(plan.states[::stride])
        yield Message("/plan", now, foxglove.poses_in_frame(now, states.tolist()))
        if not np.array_equal(record.path, self._path):
            self._path = record.path
            poses = _along(record.path[:: max(1, -(-len(record.path) // POINTS))])
            yield Message("/path", now, foxglove.poses_in_frame(now, poses.tolist()))
        if not np.array_equal(record.circles, self._circles):
            self._circles = record.circles
            rows = np.round(_finite(record.circles), 4).tolist()
            yield Message("/obstacles", now, {"timestamp": stamp(now), "circles": rows})
        due = record.time - self._scene_time >= SCENE_PERIOD - 1e-6
        if due and np.isfinite(plan.states).all():
            self._scene_time = record.time
            yield Message("/scene", now, step_scene(now, self._scenario, record))
        if record.scan is not None:
            yield Message("/scan", now, foxglove.laser_scan(now, record.scan))
        words = f"{plan.status.name.lower()}: {plan.reason}" if plan.reason else plan.status.name
        if words != self._status:
            self._status = words
            yield Message("/log", now, foxglove.log(now, f"plan {words}", bool(plan.reason)))

    def _step(self, record: Stepped, now: int, stride: int) -> dict[str, Any]:
        plan = record.plan
        clearance = plan.clearance
        return {
            "timestamp": stamp(now),
            "pose": np.round(_finite(np.array(record.pose)), 5).tolist(),
            "status": plan.status.name,
            "progress": plan.progress.name,
            "reason": plan.reason,
            "leg": list(plan.leg),
            "reachable": plan.reachable,
            "command": [round(float(part), 6) for part in plan.command],
            "clearance": round(clearance, 5) if math.isfinite(clearance) else None,
            "iterations": plan.iterations,
            "step_time": round(plan.timing["total"], 7),
            "phases": {n: round(t, 7) for n, t in plan.timing.items() if n != "total"},
            "pose_age": None if record.pose_age is None else round(record.pose_age, 5),
            "sight": None if record.scan is None else record.scan.range_max,
            "stage_time": stride * self._dt,
            "margins": np.round(_finite(record.margins[::stride]), 5).tolist(),
        }


def _finite(values: Array) -> Array:
    """Numbers that JSON can hold; a pose that is lost is shown at the origin."""
    out: Array = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    return out


def _along(points: Array) -> Array:
    """Poses (K, 3) along points (K, 2)."""
    if len(points) < 2:
        return np.column_stack([points, np.zeros(len(points))])
    steps = np.diff(points, axis=0)
    headings = np.arctan2(steps[:, 1], steps[:, 0])
    return np.column_stack([points, np.append(headings, headings[-1:])])


def _plain(values: Any) -> dict[str, Any]:
    """Values that JSON can hold: infinities become null."""
    return {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()
    }


def _json(content: dict[str, Any]) -> str:
    return json.dumps(_plain(content), allow_nan=False, default=str)
