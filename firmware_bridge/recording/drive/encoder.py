"""Makes the pieces of a recorded drive's MCAP file from records, in the thread that writes them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from firmware_bridge.recording.drive import foxglove
from firmware_bridge.recording.drive.foxglove import stamp
from firmware_bridge.recording.drive.mcap_writer import McapWriter, Message
from firmware_bridge.recording.drive.scene import map_scene, step_scene
from firmware_bridge.recording.drive.schemas import (
    TOPICS,
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
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array

FORMAT, VERSION = "kmpc.drive", "1"
BEGIN, END = "kmpc.drive", "kmpc.outcome"
"""Names of the texts at the beginning and at the end of a file."""
STAGES = 25  # so many stages of a plan are recorded at the most: every so manieth of a longer one
POINTS = 100  # so many points of a path
Told = Iterator[tuple[str, dict[str, Any]]]
SCENE_PERIOD = 0.2  # time between two scenes, which are for eyes alone [s]


class DriveEncoder:
    """Records to the bytes of a file; whoever writes these keeps their order.

    `scenario`: what is driven. `dt`: period of the controller [s]. `about`: what else to keep with
    the drive; what JSON can hold. `offset`: what is added to the times of records, so that they are
    those of the wall [s].
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
        begun = self._writer.begin("kmpc-lite") + self._writer.metadata(BEGIN, texts)
        now = self._nanoseconds(time)
        return begun + self._writer.chunk([Message("/map", now, map_scene(now, self._scenario))])

    def encode(self, records: Iterable[Record]) -> list[bytes]:
        """Give the pieces of records; each can be read by itself."""
        messages: list[Message] = []
        ended: Ended | None = None
        for record in records:
            if isinstance(record, Ended):
                ended = record
            else:
                now = self._nanoseconds(record.time)
                told = (
                    self._stepped(record, now)
                    if isinstance(record, Stepped)
                    else _told(record, now)
                )
                messages += [Message(topic, now, content) for topic, content in told]
        pieces = [self._writer.chunk(messages)]
        if ended is not None:
            outcome = _json({**ended.outcome, "end": ended.time})
            pieces.append(self._writer.metadata(END, {"outcome": outcome}) + self._writer.end())
        return list(filter(None, pieces))

    def _nanoseconds(self, time: float) -> int:
        return max(0, round(1e9 * (time + self._offset)))

    def _stepped(self, record: Stepped, now: int) -> Told:
        plan, stride = record.plan, -(-(len(record.plan.states) - 1) // STAGES)
        yield "/step", self._step(record, now, stride)
        yield "/plan", foxglove.poses_in_frame(now, _finite(plan.states[::stride]).tolist())
        if not np.array_equal(record.path, self._path):
            self._path = record.path
            poses = record.path[:: max(1, -(-len(record.path) // POINTS))]
            yield "/path", foxglove.poses_in_frame(now, poses.tolist())
        if not np.array_equal(record.circles, self._circles):
            self._circles = record.circles
            rows = np.round(_finite(record.circles), 4).tolist()
            yield "/obstacles", {"timestamp": stamp(now), "circles": rows}
        due = record.time - self._scene_time >= SCENE_PERIOD - 1e-6
        if due and np.isfinite(plan.states).all():
            self._scene_time = record.time
            yield "/scene", step_scene(now, self._scenario, record)
        if record.scan is not None:
            yield "/scan", foxglove.laser_scan(now, record.scan)
        words = f"{plan.status.name.lower()}: {plan.reason}" if plan.reason else plan.status.name
        if words != self._status:
            self._status = words
            yield "/log", foxglove.log(now, f"plan {words}", bool(plan.reason))

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


def _told(record: Record, now: int) -> Told:
    """Topics and messages of a record that is not a step."""
    at = {"timestamp": stamp(now)}
    match record:
        case PoseSeen(_, pose) if all(map(math.isfinite, pose)):
            yield "/pose", foxglove.pose_in_frame(now, pose)
            yield "/tf", foxglove.transform(now, pose)
        case TruePose(_, pose):
            yield "/truth", foxglove.pose_in_frame(now, pose)
        case Sent(_, command):
            speeds = (round(speed, 6) for speed in command)
            yield "/command", {**at, **dict(zip(("v", "omega", "vy"), speeds, strict=True))}
        case Gate(_, state, reasons):
            yield "/gate", {**at, "state": state, "reasons": list(reasons)}
            words = ": ".join(filter(None, (f"gate {state.lower()}", ", ".join(reasons))))
            yield "/log", foxglove.log(now, words, bool(reasons))
        case Health(_, values):
            yield "/health", {**_plain(values), **at}
        case Note(_, text, bad):
            yield "/log", foxglove.log(now, text, bad)


def _finite(values: Array) -> Array:
    """Numbers that JSON can hold; a pose that is lost is shown at the origin."""
    out: Array = np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    return out


def _plain(values: Any) -> dict[str, Any]:
    """Values that JSON can hold: infinities become null."""
    return {
        k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()
    }


def _json(content: dict[str, Any]) -> str:
    return json.dumps(_plain(content), allow_nan=False, default=str)
