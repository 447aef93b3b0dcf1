"""Topics of a recorded drive, and the JSON schemas of their kinds, made from an example of each.

Foxglove's kinds are described at https://docs.foxglove.dev/docs/sdk/schemas; here stands the part
of each that is written.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from firmware_bridge.recording.drive import foxglove as fg
from firmware_bridge.recording.drive.mcap_writer import Topic
from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array

Schema = dict[str, Any]
KINDS = {bool: "boolean", int: "integer", float: "number", str: "string"}


def schema_of(example: Any) -> Schema:
    """Describe what is like an example: all its parts are there; None is a number or null.

    Examples
    --------
    >>> schema_of({"v": 0.0})["properties"]
    {'v': {'type': 'number'}}
    """
    if example is None:
        return {"anyOf": [schema_of(0.0), {"type": "null"}]}
    if isinstance(example, list):
        return {"type": "array", "items": schema_of(example[0] if example else {})}
    if isinstance(example, dict):
        parts = {name: schema_of(part) for name, part in example.items()}
        return {"type": "object", "properties": parts, "required": list(parts)}
    return {"type": KINDS[type(example)]}


TIME = {"timestamp": fg.stamp(0)}
PAINT = fg.colour("#000000")
LINE = {**fg.line([fg.ORIGIN], 0.0, PAINT), "colors": [PAINT], "indices": [0]}
SHAPES: dict[str, Any] = {
    "cylinders": [fg.disc(0.0, 0.0, 0.0, 0.0, PAINT)],
    "lines": [LINE],
    "cubes": [fg.box(fg.ORIGIN, (0.0, 0.0), 0.0, PAINT)],
    "arrows": [fg.arrow(0.0, 0.0, 0.0, 0.0, PAINT)],
}
SCAN = {**TIME, "frame_id": "", "pose": fg.pose(*fg.ORIGIN), "start_angle": 0.0, "end_angle": 0.0}
STEP = {
    **TIME,
    "pose": [0.0],
    "status": "",
    "progress": "",
    "reason": "",
    "reachable": True,
    "command": [0.0],
    "clearance": None,
    "iterations": 0,
    "step_time": 0.0,
    "phases": {},
    "pose_age": None,
    "sight": None,
    "stage_time": 0.0,
    "margins": [0.0],
}
EXAMPLES = {
    "foxglove.PoseInFrame": fg.pose_in_frame(0, fg.ORIGIN),
    "foxglove.PosesInFrame": fg.poses_in_frame(0, [fg.ORIGIN]),
    "foxglove.FrameTransform": fg.transform(0, fg.ORIGIN),
    "foxglove.SceneUpdate": fg.scene([fg.entity(0, "", frame="", **SHAPES)]),
    "foxglove.LaserScan": {**SCAN, "ranges": [0.0], "intensities": [0.0]},
    "foxglove.Log": fg.log(0, ""),
    "kmpc.Command": {**TIME, "v": 0.0, "omega": 0.0, "vy": 0.0},
    "kmpc.Step": STEP,
    "kmpc.Obstacles": {**TIME, "circles": [[0.0]]},
    "kmpc.Gate": {**TIME, "state": "", "reasons": [""]},
    "kmpc.Health": TIME,
}
NAMES = {
    "/pose": "foxglove.PoseInFrame",
    "/truth": "foxglove.PoseInFrame",
    "/tf": "foxglove.FrameTransform",
    "/command": "kmpc.Command",
    "/step": "kmpc.Step",
    "/plan": "foxglove.PosesInFrame",
    "/path": "foxglove.PosesInFrame",
    "/map": "foxglove.SceneUpdate",
    "/scene": "foxglove.SceneUpdate",
    "/obstacles": "kmpc.Obstacles",
    "/scan": "foxglove.LaserScan",
    "/gate": "kmpc.Gate",
    "/health": "kmpc.Health",
    "/log": "foxglove.Log",
}
TOPICS = tuple(
    Topic(topic, kind, {"title": kind, **schema_of(EXAMPLES[kind])})
    for topic, kind in NAMES.items()
)
"""All that a recorded drive may hold."""


class PoseSeen(NamedTuple):
    """A pose, as it was measured."""

    time: float  # when it was true [s]
    pose: tuple[float, float, float]  # x, y [m], theta [rad]


class TruePose(NamedTuple):
    """Where the robot really was, which a simulation knows."""

    time: float
    pose: tuple[float, float, float]


class Sent(NamedTuple):
    """A command that went to the robot."""

    time: float
    command: tuple[float, float, float]
    """v [m/s], omega [rad/s], and of an omni its speed to the left [m/s]."""


class Stepped(NamedTuple):
    """A step of the controller: what it was given, and its plan."""

    time: float  # when the step began [s]
    pose: tuple[float, float, float]  # what it planned from
    plan: Plan
    path: Array  # (K, 3) that guidance follows [m, m, rad]
    margins: Array  # (N,) of the stages of the plan [m]
    circles: Array  # (M, 5) obstacles: x, y, radius [m], vx, vy [m/s]
    pose_age: float | None = None  # age of the pose when the step began [s]
    scan: Any = None  # `LaserScan` that it was given


class Gate(NamedTuple):
    """The safety gate came to a state, or to other reasons for it."""

    time: float
    state: str
    reasons: tuple[str, ...] = ()


class Health(NamedTuple):
    """State of link and vehicle, now and then."""

    time: float
    values: Mapping[str, Any]  # what JSON can hold


class Note(NamedTuple):
    """Something that a person should read."""

    time: float
    text: str
    bad: bool = False


class Ended(NamedTuple):
    """The drive is over."""

    time: float
    outcome: Mapping[str, Any]  # what JSON can hold: see `kmpc_lab.recording.simulated`


Record = PoseSeen | TruePose | Sent | Stepped | Gate | Health | Note | Ended
