"""JSON schemas of what is recorded: Foxglove's own kinds by its names, and this project's.

Foxglove's are described at https://docs.foxglove.dev/docs/sdk/schemas; here stands the part of each
that is written.
"""

from __future__ import annotations

from typing import Any

from firmware_bridge.recording.drive.mcap_writer import Topic

Schema = dict[str, Any]
NUMBER: Schema = {"type": "number"}
INTEGER: Schema = {"type": "integer"}
TEXT: Schema = {"type": "string"}
TRUTH: Schema = {"type": "boolean"}
NUMBERS: Schema = {"type": "array", "items": NUMBER}


def table(title: str = "", /, **parts: Schema) -> Schema:
    """Describe an object, all of whose parts are there."""
    named = {"title": title} if title else {}
    return {**named, "type": "object", "properties": parts, "required": list(parts)}


def numbers(names: str) -> dict[str, Schema]:
    """Describe numbers by their names, parted by blanks."""
    return dict.fromkeys(names.split(), NUMBER)


def many(items: Schema) -> Schema:
    """Describe a list."""
    return {"type": "array", "items": items}


def either(schema: Schema) -> Schema:
    """Describe what may also be null: it is not known."""
    return {"anyOf": [schema, {"type": "null"}]}


TIME = table(sec=INTEGER, nsec=INTEGER)
VECTOR = table(**numbers("x y z"))
QUATERNION = table(**numbers("x y z w"))
POSE = table(position=VECTOR, orientation=QUATERNION)
COLOUR = table(**numbers("r g b a"))
CYLINDER = table(pose=POSE, size=VECTOR, **numbers("bottom_scale top_scale"), color=COLOUR)
CUBE = table(pose=POSE, size=VECTOR, color=COLOUR)
ARROW_SIZES = numbers("shaft_length shaft_diameter head_length head_diameter")
ARROW = table(pose=POSE, **ARROW_SIZES, color=COLOUR)
LINE = table(
    type=INTEGER,
    pose=POSE,
    thickness=NUMBER,
    scale_invariant=TRUTH,
    points=many(VECTOR),
    color=COLOUR,
    colors=many(COLOUR),
    indices=many(INTEGER),
)
ANY = many({"type": "object"})
ENTITY = table(
    timestamp=TIME,
    frame_id=TEXT,
    id=TEXT,
    lifetime=TIME,
    frame_locked=TRUTH,
    metadata=many(table(key=TEXT, value=TEXT)),
    arrows=many(ARROW),
    cubes=many(CUBE),
    spheres=ANY,
    cylinders=many(CYLINDER),
    lines=many(LINE),
    triangles=ANY,
    texts=ANY,
    models=ANY,
)
SCENE = table("foxglove.SceneUpdate", deletions=ANY, entities=many(ENTITY))
POSE_IN_FRAME = table("foxglove.PoseInFrame", timestamp=TIME, frame_id=TEXT, pose=POSE)
POSES_IN_FRAME = table("foxglove.PosesInFrame", timestamp=TIME, frame_id=TEXT, poses=many(POSE))
TRANSFORM = table(
    "foxglove.FrameTransform",
    timestamp=TIME,
    parent_frame_id=TEXT,
    child_frame_id=TEXT,
    translation=VECTOR,
    rotation=QUATERNION,
)
SCAN = table(
    "foxglove.LaserScan",
    timestamp=TIME,
    frame_id=TEXT,
    pose=POSE,
    start_angle=NUMBER,
    end_angle=NUMBER,
    ranges=NUMBERS,
    intensities=NUMBERS,
)
LOG = table(
    "foxglove.Log",
    timestamp=TIME,
    level=INTEGER,
    message=TEXT,
    name=TEXT,
    file=TEXT,
    line=INTEGER,
)
COMMAND = table("kmpc.Command", timestamp=TIME, **numbers("v omega vy"))
STEP = table(
    "kmpc.Step",
    timestamp=TIME,
    pose=NUMBERS,
    status=TEXT,
    progress=TEXT,
    reason=TEXT,
    reachable=TRUTH,
    command=NUMBERS,
    clearance=either(NUMBER),
    iterations=INTEGER,
    step_time=NUMBER,
    phases={"type": "object", "additionalProperties": NUMBER},
    pose_age=either(NUMBER),
    sight=either(NUMBER),
    stage_time=NUMBER,
    margins=NUMBERS,
)
OBSTACLES = table("kmpc.Obstacles", timestamp=TIME, circles=many(NUMBERS))
GATE = table("kmpc.Gate", timestamp=TIME, state=TEXT, reasons=many(TEXT))
HEALTH = table("kmpc.Health", timestamp=TIME)
TOPICS = tuple(
    Topic(name, description["title"], description)
    for name, description in (
        ("/pose", POSE_IN_FRAME),
        ("/truth", POSE_IN_FRAME),
        ("/tf", TRANSFORM),
        ("/command", COMMAND),
        ("/step", STEP),
        ("/plan", POSES_IN_FRAME),
        ("/path", POSES_IN_FRAME),
        ("/map", SCENE),
        ("/scene", SCENE),
        ("/obstacles", OBSTACLES),
        ("/scan", SCAN),
        ("/gate", GATE),
        ("/health", HEALTH),
        ("/log", LOG),
    )
)
"""All that a recorded drive may hold."""
