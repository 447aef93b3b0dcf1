"""Foxglove's messages, as JSON: poses, lines and solid shapes in the map's frame."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

from firmware_bridge.recording.drive.seen import told_ranges
from kmpc_lite.control.world.scan import LaserScan

Content = dict[str, Any]
MAP, ROBOT = "map", "base_link"
"""Frames: x east and y north; and the robot's, x ahead and y to the left."""
STRIP, LOOP = 0, 1  # kinds of lines: open, and closed
INFO, WARNING = 2, 3  # levels of log messages
DIGITS = 4  # of lengths: a tenth of a millimetre
ORIGIN = (0.0, 0.0, 0.0)
SHAPES = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
"""That an entity may have."""


def stamp(nanoseconds: int) -> Content:
    """Time of a message."""
    return {"sec": nanoseconds // 10**9, "nsec": nanoseconds % 10**9}


def vector(x: float, y: float, z: float = 0.0) -> Content:
    """Place, or size."""
    return {"x": round(x, DIGITS), "y": round(y, DIGITS), "z": round(z, DIGITS)}


def quaternion(heading: float) -> Content:
    """Turn by a heading [rad]."""
    half = heading / 2
    return {"x": 0.0, "y": 0.0, "z": round(math.sin(half), 6), "w": round(math.cos(half), 6)}


def pose(x: float, y: float, heading: float, z: float = 0.0) -> Content:
    """Pose in the plane, or above it."""
    return {"position": vector(x, y, z), "orientation": quaternion(heading)}


def _head(time: int, frame: str = MAP) -> Content:
    return {"timestamp": stamp(time), "frame_id": frame}


def pose_in_frame(time: int, place: Sequence[float]) -> Content:
    """A ``foxglove.PoseInFrame``."""
    return {**_head(time), "pose": pose(*place)}


def poses_in_frame(time: int, places: Iterable[Sequence[float]]) -> Content:
    """A ``foxglove.PosesInFrame``."""
    return {**_head(time), "poses": [pose(*place) for place in places]}


def transform(time: int, place: Sequence[float]) -> Content:
    """A ``foxglove.FrameTransform`` that puts the robot on the map."""
    return {
        "timestamp": stamp(time),
        "parent_frame_id": MAP,
        "child_frame_id": ROBOT,
        "translation": vector(place[0], place[1]),
        "rotation": quaternion(place[2]),
    }


def laser_scan(time: int, scan: LaserScan) -> Content:
    """A ``foxglove.LaserScan``: -1 for a beam that tells nothing, -2 for one that met nothing."""
    sense = -1.0 if scan.mirrored else 1.0
    first, step = sense * scan.angle_min, sense * scan.angle_increment
    return {
        **_head(time, ROBOT),
        "pose": pose(*scan.mount),
        "start_angle": first,
        "end_angle": first + step * (len(scan) - 1),
        "ranges": [round(r, DIGITS) for r in told_ranges(scan).tolist()],
        "intensities": [],
    }


def log(time: int, text: str, bad: bool = False) -> Content:
    """A ``foxglove.Log``."""
    level = WARNING if bad else INFO
    head = {"timestamp": stamp(time), "level": level, "message": text}
    return {**head, "name": "kmpc", "file": "", "line": 0}


def colour(code: str, alpha: float = 1.0) -> Content:
    """Colour of a code like ``#0072b2``."""
    red, green, blue = (int(code[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return {"r": round(red, 3), "g": round(green, 3), "b": round(blue, 3), "a": alpha}


def disc(
    x: float, y: float, radius: float, height: float, paint: Content, z: float = 0.0
) -> Content:
    """A cylinder that stands on the floor, or `z` above it [m]."""
    size = vector(2 * radius, 2 * radius, height)
    place = {"pose": pose(x, y, 0.0, z + height / 2), "size": size}
    return {**place, "bottom_scale": 1.0, "top_scale": 1.0, "color": paint}


def box(centre: Sequence[float], size: Sequence[float], height: float, paint: Content) -> Content:
    """A cuboid that stands on the floor: centre x, y, heading, and size along and across [m]."""
    x, y, heading = centre
    place = pose(x, y, heading, height / 2)
    return {"pose": place, "size": vector(size[0], size[1], height), "color": paint}


def arrow(x: float, y: float, heading: float, length: float, paint: Content) -> Content:
    """An arrow that lies on the floor."""
    shares = {"shaft_length": 0.7, "shaft_diameter": 0.1, "head_length": 0.3, "head_diameter": 0.25}
    sizes = {name: round(share * length, DIGITS) for name, share in shares.items()}
    return {"pose": pose(x, y, heading), **sizes, "color": paint}


def line(
    points: Iterable[Sequence[float]],
    thickness: float,
    paint: Content,
    kind: int = STRIP,
    z: float = 0.0,
) -> Content:
    """A line of a thickness in metres."""
    told = [vector(float(p[0]), float(p[1]), z) for p in points]
    drawn = {"thickness": round(thickness, DIGITS), "scale_invariant": False, "points": told}
    head = {"type": kind, "pose": pose(*ORIGIN)}
    return {**head, **drawn, "color": paint, "colors": [], "indices": []}


def entity(time: int, name: str, *, frame: str = MAP, **shapes: Sequence[Content]) -> Content:
    """A ``foxglove.SceneEntity`` of arrows, cubes, cylinders and lines.

    It stays until one of its name comes.
    """
    head = {"id": name, "lifetime": {"sec": 0, "nsec": 0}, "frame_locked": True, "metadata": []}
    return {**_head(time, frame), **head, **{kind: list(shapes.get(kind, ())) for kind in SHAPES}}


def scene(entities: Sequence[Content]) -> Content:
    """A ``foxglove.SceneUpdate``."""
    return {"deletions": [], "entities": list(entities)}
