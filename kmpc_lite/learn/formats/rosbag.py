"""ROS bags of every kind, streamed: topics are found by type, others are not even unpacked."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from math import isfinite, nan
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import heading_of
from kmpc_lite.learn.formats.columns import MEASURED, short
from kmpc_lite.learn.formats.streams import Thinned, two_or_three
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic
from kmpc_lite.reading import open_regular

ACKERMANN = "ackermann_msgs/msg/AckermannDrive"
ACKERMANN_STAMPED = f"{ACKERMANN}Stamped"
_NAMES = ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
FIELDS = {
    ACKERMANN: "".join(f"float32 {name}\n" for name in _NAMES),
    ACKERMANN_STAMPED: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive",
    **dict.fromkeys(TF, "geometry_msgs/TransformStamped[] transforms"),
}
"""Messages that not every distribution has by itself."""
ODOMETRY, POSE = "nav_msgs/msg/Odometry", "geometry_msgs/msg/PoseStamped"
TWIST, STEERED = "geometry_msgs/msg/Twist", (ACKERMANN_STAMPED, ACKERMANN)
KINDS = {
    "odom": (ODOMETRY, POSE, "geometry_msgs/msg/PoseWithCovarianceStamped", *TF),
    "cmd": (TWIST, f"{TWIST}Stamped", *STEERED),
}
"""Types of poses and of commands, in the order in which they are preferred."""
USUAL = {"odom": ("/odom", "/odometry/filtered"), "cmd": ("/cmd_vel", "/drive")}
"""Names of topics that are preferred where several topics have the right type."""
OTHER = {
    "odom": ("goal", "initial", "target", "setpoint", "waypoint", "clicked", "_static"),
    "cmd": ("odom", "imu", "measured", "feedback", "local_position", "global_position", "actual"),
}
"""Parts of names of topics that hold something else than the robot's pose, or its command."""
BODIES = ("base_footprint", "base_link", "base", "body", "chassis")  # frames of the robot in TF
LOOK, TELLING = 2000, 5000
"""Messages of TF in which the robot's frame must stand; those between two looks at the progress."""
SAME_CLOCK = 1.0
"""Stamps that differ by more than this from the time of recording come from another clock [s]."""
CUT = "the bag is cut off, by a power failure or while it was copied: "
METADATA = "its metadata.yaml is not whole: `ros2 bag reindex` writes it anew"
TORN = {
    "end magic": f"{CUT}`mcap recover` mends it",
    "index looks damaged": f"{CUT}`rosbag reindex` mends it",
    "Cannot open database": f"{CUT}`sqlite3 FILE .recover` mends it",
    "Storage plugin": METADATA,
    "metadata key": METADATA,
}
"""What damages a bag, by a part of what its reader says."""
MAX_METADATA = 2**24  # largest metadata.yaml that is read [bytes]


class Wanted(NamedTuple):
    """A topic that is read, and which part of its messages."""

    topic: str
    kind: str
    frames: tuple[str, str] | None = None  # of TF: parent and child


def read_bag(path: Path, options: ReadOptions) -> Log:
    """Read poses and commands of a rosbag2 folder, an .mcap, a .db3 or a ROS 1 .bag."""
    with _opened(path) as (reader, decode):
        topics = _topics(reader)
        pose = command = _find(path, topics, "odom", options.topics)
        commands = any(t.kind in KINDS["cmd"] and t.messages for t in topics)
        measured = pose.kind == ODOMETRY and not commands and "cmd" not in options.topics
        if not measured:
            command = _find(path, topics, "cmd", options.topics)
            measured = command.kind == ODOMETRY
        if pose.kind in TF:
            pose = _with_frames(path, pose, reader, decode)
        series, broken = _collect(reader, decode, pose, command, options)
    poses, commanded = (_series(path, w, s) for w, s in zip((pose, command), series, strict=True))
    notes = [f"poses: {poses.source}; commands: {commanded.source}"]
    if measured:
        notes.append(f"{MEASURED} (--topics cmd=NAME tells where they are)")
    if broken:
        notes.append(f"{broken} messages without an orientation or with NaN were left out")
    log = Log(str(path), poses, commanded, measured=measured, topics=topics, notes=tuple(notes))
    turn = "steering" if command.kind in STEERED else "omega"
    return two_or_three(replace(log, columns=("v", "lateral", turn)))


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Callable[[bytes, str], Any]]]:
    """Open a bag; give its reader and what decodes its messages."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        if not part.is_dir():  # no pipes, devices and endless descriptions
            open_regular(part, MAX_METADATA if part.suffix == ".yaml" else None).close()
    try:
        first = False
        if path.is_file():
            with open_regular(path) as file:
                first = file.read(7) == b"#ROSBAG"
        # the types that are read are the same in every distribution
        store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
        for kind in FIELDS.keys() - store.types.keys():
            store.register(get_types_from_msg(FIELDS[kind], kind))
        with Reader1(path) if first else Reader2(path) as reader:
            yield reader, store.deserialize_ros1 if first else store.deserialize_cdr
    except (DataError, KeyboardInterrupt):
        raise
    except Exception as error:  # rosbags, apsw, lz4, zstd and yaml all have exceptions of their own
        said = " ".join(str(error).split()) or type(error).__name__
        told = next((words for sign, words in TORN.items() if sign in said), "")
        told = told or f"not a ROS bag, or damaged: {short(said)}"
        raise DataError(f"{path}: {told}") from error


def _topics(reader: Any) -> tuple[Topic, ...]:
    """All topics of a bag."""
    seconds = max((reader.end_time - reader.start_time) * 1e-9, 0.0) if reader.message_count else 0
    counts: dict[tuple[str, str], int] = {}
    for c in reader.connections:
        counts[c.topic, c.msgtype] = counts.get((c.topic, c.msgtype), 0) + c.msgcount
    return tuple(
        Topic(name, kind, count, count / seconds if seconds else None)
        for (name, kind), count in sorted(counts.items())
    )


def _find(path: Path, topics: Sequence[Topic], name: str, chosen: Mapping[str, str]) -> Wanted:
    """Find the one topic of a pose, or of a command, that is meant."""
    what, kinds = ("a pose" if name == "odom" else "a command"), KINDS[name]
    if name in chosen:
        kinds += (ODOMETRY,) if name == "cmd" else ()
        named = [t for t in topics if t.name.strip("/") == chosen[name].strip("/")]
        for topic in named:
            if topic.kind in kinds and topic.messages:
                return Wanted(topic.name, topic.kind)
        got = f"it is {named[0].kind} with {named[0].messages} messages" if named else ""
        raise DataError(
            f"{path}: topics: {name}={chosen[name]}: {got or 'no such topic'}; {what} is one of "
            f"{', '.join(kinds)}, here {_listed([t for t in topics if t.kind in kinds])}"
        )
    moving = [t for t in topics if t.messages and not any(o in t.name for o in OTHER[name])]
    for kind in kinds:
        found = [t for t in moving if t.kind == kind]
        usual = [t for u in USUAL[name] for t in found if t.name == u] or found[: len(found) == 1]
        if usual:
            return Wanted(usual[0].name, kind)
        if found:
            raise DataError(
                f"{path}: {len(found)} topics of type {kind} could be {what}: {_listed(found)}; "
                f"choose with --topics {name}={found[0].name}"
            )
    empty = [t for t in topics if t.kind in kinds]
    told = f"{_listed(empty)}: no messages" if empty else f"the bag has {_listed(topics)}"
    raise DataError(f"{path}: no topic with {what} ({', '.join(kinds)}); {told}")


def _listed(topics: Sequence[Topic]) -> str:
    """Names of topics, as many as fit a line."""
    more = f" and {len(topics) - 5} more" if len(topics) > 5 else ""
    return ", ".join(short(t.name) for t in topics[:5]) + more or "none"


def _with_frames(path: Path, wanted: Wanted, reader: Any, decode: Any) -> Wanted:
    """Find the transform that carries the robot in the first messages of TF."""
    pairs: dict[tuple[str, str], int] = {}
    for n, (_, _, raw) in enumerate(reader.messages(_connections(reader, wanted))):
        if n >= LOOK:
            break
        for transform in decode(raw, wanted.kind).transforms:
            pair = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
            pairs[pair] = pairs.get(pair, 0) + 1
    for body in BODIES:
        if found := [pair for pair in pairs if pair[1].rpartition("/")[2] == body]:
            return wanted._replace(frames=max(found, key=lambda pair: pairs[pair]))
    listed = ", ".join(sorted({child for _, child in pairs})[:5])
    raise DataError(
        f"{path}: {wanted.topic} carries no frame of a robot ({', '.join(BODIES)}); it carries "
        f"{short(listed) or 'nothing'}"
    )


def _connections(reader: Any, *wanted: Wanted) -> list[Any]:
    """Connections of topics."""
    meant = [(w.topic, w.kind) for w in wanted]
    return [c for c in reader.connections if (c.topic, c.msgtype) in meant]


def _collect(
    reader: Any, decode: Any, pose: Wanted, command: Wanted, options: ReadOptions
) -> tuple[tuple[Thinned, Thinned], int]:
    """Go through the messages once. Each sample keeps its stamp beside its time of recording."""
    poses, commands, broken = Thinned(4, options.spacing), Thinned(4, options.spacing), 0
    wanted, progress = _connections(reader, pose, command), options.progress
    total = sum(c.msgcount for c in wanted)
    for n, (connection, nanoseconds, raw) in enumerate(reader.messages(wanted)):
        if progress is not None and n % TELLING == 0:
            progress(n, max(total, n))
        time, here = nanoseconds * 1e-9, (connection.topic, connection.msgtype)
        message = None
        for meant, read, kept in ((pose, _pose, poses), (command, _command, commands)):
            if here != (meant.topic, meant.kind) or not kept.wants(time):
                continue
            message = decode(raw, connection.msgtype) if message is None else message
            values = read(message, meant)
            if values is not None and all(map(isfinite, values)):
                kept.add(time, *values)
            elif values is not None:
                broken += 1
    if progress is not None and total:
        progress(total, total)
    return (poses, commands), broken


def _stamp(message: Any) -> float:
    """Time of a message's header [s]; 0 if it has none or has not been set."""
    header = getattr(message, "header", None)
    return 0.0 if header is None else header.stamp.sec + 1e-9 * header.stamp.nanosec


def _pose(message: Any, wanted: Wanted) -> tuple[float, ...] | None:
    """Stamp, x, y and theta; NaN without an orientation, None if TF has others only."""
    if wanted.frames is None:
        pose = message.pose if wanted.kind == POSE else message.pose.pose
        place, turn = pose.position, pose.orientation
    else:
        for t in message.transforms:
            if (t.header.frame_id.strip("/"), t.child_frame_id.strip("/")) == wanted.frames:
                message, place, turn = t, t.transform.translation, t.transform.rotation
                break
        else:
            return None
    whole = turn.x**2 + turn.y**2 + turn.z**2 + turn.w**2 >= 0.5
    heading = float(heading_of(turn.x, turn.y, turn.z, turn.w)) if whole else nan
    return _stamp(message), place.x, place.y, heading


def _command(message: Any, wanted: Wanted) -> tuple[float, ...]:
    """Stamp, v, speed to the left, and omega or a steering angle."""
    if wanted.kind in STEERED:
        drive = message.drive if wanted.kind == ACKERMANN_STAMPED else message
        return _stamp(message), drive.speed, 0.0, drive.steering_angle
    twist = message
    while hasattr(twist, "twist"):
        twist = twist.twist
    # measured, it may be slip
    aside = 0.0 if wanted.kind == ODOMETRY else twist.linear.y
    return _stamp(message), twist.linear.x, aside, twist.angular.z


def _series(path: Path, wanted: Wanted, samples: Thinned) -> Series:
    """Samples at their stamps where those are of the recording's clock, else as recorded."""
    rows = samples.rows()
    if len(rows) < 2:
        raise DataError(
            f"{path}: {wanted.topic}: {len(rows)} message(s) that can be used; expected at least 2"
        )
    recorded, stamps = rows[:, :2].T
    same = np.abs(stamps - recorded).max() < SAME_CLOCK and (np.diff(stamps) > 0.0).all()
    frames = " {} -> {}".format(*wanted.frames) if wanted.frames else ""
    source = f"{wanted.topic} ({wanted.kind}{frames})"
    return Series(stamps if same else recorded, rows[:, 2:], source)
