"""Topics of a recorded drive, and the JSON schemas of their kinds, made from an example of each.

Foxglove's kinds are described at https://docs.foxglove.dev/docs/sdk/schemas; here stands the part
of each that is written.
"""

from __future__ import annotations

from typing import Any

from firmware_bridge.recording.drive import foxglove as fg
from firmware_bridge.recording.drive.mcap_writer import Topic

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
