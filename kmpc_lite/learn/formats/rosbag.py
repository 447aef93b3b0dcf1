"""ROS bags of every kind, streamed: topics are found by type, others are not even unpacked."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import isfinite
from pathlib import Path
from typing import Any

from kmpc_lite.errors import DataError
from kmpc_lite.geometry import heading_of
from kmpc_lite.learn.formats.columns import short
from kmpc_lite.learn.formats.streams import Thinned, stamps_of
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic
from kmpc_lite.reading import open_regular

ACKERMANN = "ackermann_msgs/msg/AckermannDrive"
ACKERMANN_STAMPED = "ackermann_msgs/msg/AckermannDriveStamped"
STEERED = (ACKERMANN_STAMPED, ACKERMANN)
"""Commands of cars."""
FIELDS = {
    ACKERMANN: "".join(
        f"float32 {name}\n"
        for name in ("steering_angle", "steering_angle_velocity", "speed", "acceleration", "jerk")
    ),
    ACKERMANN_STAMPED: "std_msgs/Header header\nackermann_msgs/AckermannDrive drive",
}
"""Messages that no distribution has by itself."""
ODOMETRY = "nav_msgs/msg/Odometry"
POSE = "geometry_msgs/msg/PoseStamped"
POSE_COVARIANCE = "geometry_msgs/msg/PoseWithCovarianceStamped"
TF = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
TWIST = "geometry_msgs/msg/Twist"
TWIST_STAMPED = "geometry_msgs/msg/TwistStamped"
POSE_TYPES = (ODOMETRY, POSE, POSE_COVARIANCE, *TF)
"""In the order in which they are preferred."""
COMMAND_TYPES = (TWIST, TWIST_STAMPED, *STEERED)
LOOK = 2000
"""Messages of TF in which the robot's frame must stand."""
TELLING = 5000
"""Messages between two looks at the progress."""
OTHER = {
    "odom": ("goal", "initial", "target", "setpoint", "waypoint", "clicked", "_static"),
    "cmd": ("odom", "imu", "measured", "feedback", "local_position", "global_position", "actual"),
}
"""Parts of names of topics that hold something else than the robot's pose, or its command."""
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
MAX_METADATA = 2**24
"""Largest metadata.yaml that is read [bytes]."""
USUAL = {"odom": ("/odom", "/odometry/filtered"), "cmd": ("/cmd_vel", "/drive")}
"""Names of topics that are preferred where several topics have the right type."""
BODIES = ("base_footprint", "base_link", "base", "body", "chassis")
"""Frames of the robot in TF."""


@dataclass(frozen=True)
class Wanted:
    """A topic that is read, and which part of its messages."""

    topic: str
    kind: str
    frames: tuple[str, str] | None = None
    """Of TF: parent and child."""


def read_bag(path: Path, options: ReadOptions) -> Log:
    """Read poses and commands of a rosbag2 folder, an .mcap, a .db3 or a ROS 1 .bag."""
    with _opened(path) as (reader, decode):
        topics = _topics(reader)
        pose, command = _choose(path, topics, options.topics)
        if pose.kind in TF:
            pose = _with_frames(path, pose, reader, decode)
        series, broken = _collect(reader, decode, pose, command, options)
    poses, commands = (_series(path, w, s) for w, s in zip((pose, command), series, strict=True))
    notes = [f"poses: {poses.source}; commands: {commands.source}"]
    if measured := command.kind == ODOMETRY:
        notes.append("no commands are in the bag: the odometry's measured speeds stand in for them")
    if broken:
        notes.append(f"{broken} messages without an orientation or with NaN were left out")
    kinds = ("v", "steering") if command.kind in STEERED else ("v", "omega")
    return Log(str(path), poses, commands, False, measured, topics, tuple(notes), columns=kinds)


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Callable[[bytes, str], Any]]]:
    """Open a bag; give its reader and what decodes its messages."""
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    _check_files(path)
    try:
        first = path.is_file() and _is_ros1(path)
        # the types that are read are the same in every distribution
        store = get_typestore(Stores.ROS1_NOETIC if first else Stores.ROS2_HUMBLE)
        for kind in set(TF) - store.types.keys():
            store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", kind))
        for kind in set(FIELDS) - store.types.keys():
            store.register(get_types_from_msg(FIELDS[kind], kind))
        with Reader1(path) if first else Reader2(path) as reader:
            yield reader, store.deserialize_ros1 if first else store.deserialize_cdr
    except (DataError, KeyboardInterrupt):
        raise
    except Exception as error:  # rosbags, apsw, lz4, zstd and yaml all have exceptions of their own
        for sign, words in TORN.items():
            if sign in str(error):
                raise DataError(f"{path}: {words}") from error
        raise DataError(f"{path}: not a ROS bag, or damaged: {_one_line(error)}") from error


def _check_files(path: Path) -> None:
    """Refuse pipes, devices and endless descriptions, before rosbags opens them.

    Raises
    ------
    OSError
        If one of the bag's files is none.
    """
    for part in sorted(path.iterdir()) if path.is_dir() else [path]:
        if not part.is_dir():
            open_regular(part, MAX_METADATA if part.suffix == ".yaml" else None).close()


def _one_line(error: Exception) -> str:
    """What a library says, shortened to fit a line."""
    return short(" ".join(str(error).split()) or type(error).__name__)


def _is_ros1(path: Path) -> bool:
    """Whether a file is a ROS 1 bag."""
    with open_regular(path) as file:
        return file.read(7) == b"#ROSBAG"


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


def _choose(path: Path, topics: tuple[Topic, ...], chosen: Any) -> tuple[Wanted, Wanted]:
    """Choose the topics of the pose and of the command."""
    pose = _find(path, topics, "odom", POSE_TYPES, chosen)
    if "cmd" not in chosen and pose.kind == ODOMETRY:
        commands = any(t.kind in COMMAND_TYPES and t.messages for t in topics)
        if not commands:
            return pose, pose
    types = (*COMMAND_TYPES, ODOMETRY) if "cmd" in chosen else COMMAND_TYPES
    return pose, _find(path, topics, "cmd", types, chosen)


def _find(
    path: Path, topics: tuple[Topic, ...], name: str, types: tuple[str, ...], chosen: Any
) -> Wanted:
    """Find the one topic that is meant."""
    what = "a pose" if name == "odom" else "a command"
    if name in chosen:
        named = [t for t in topics if t.name.strip("/") == chosen[name].strip("/")]
        good = [t for t in named if t.kind in types]
        if good and good[0].messages:
            return Wanted(good[0].name, good[0].kind)
        got = (
            f"it is {named[0].kind} with {named[0].messages} messages" if named else "no such topic"
        )
        raise DataError(
            f"{path}: topics: {name}={chosen[name]}: {got}; {what} is one of "
            f"{', '.join(types)}, here {_listed([t for t in topics if t.kind in types])}"
        )
    for kind in types:
        moving = [t for t in topics if t.messages and not any(o in t.name for o in OTHER[name])]
        found = [t for t in moving if t.kind == kind]
        usual = [t for t in found if t.name in USUAL[name]]
        if len(found) == 1 or usual:
            best = min(usual, key=lambda t: USUAL[name].index(t.name)) if usual else found[0]
            return Wanted(best.name, best.kind)
        if found:
            raise DataError(
                f"{path}: {len(found)} topics of type {kind} could be {what}: {_listed(found)}; "
                f"choose with --topics {name}={found[0].name}"
            )
    empty = [t for t in topics if t.kind in types]
    raise DataError(
        f"{path}: no topic with {what} ({', '.join(types)}); "
        + (f"{_listed(empty)}: no messages" if empty else f"the bag has {_listed(list(topics))}")
    )


def _listed(topics: list[Topic]) -> str:
    """Names of topics, as many as fit a line."""
    names = [t.name for t in topics]
    more = f" and {len(names) - 5} more" if len(names) > 5 else ""
    return ", ".join(short(n) for n in names[:5]) + more if names else "none"


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
        found = [pair for pair in pairs if pair[1].rpartition("/")[2] == body]
        if found:
            return Wanted(wanted.topic, wanted.kind, max(found, key=lambda pair: pairs[pair]))
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
    spacing, progress = options.spacing, options.progress
    poses, commands, broken = Thinned(4, spacing), Thinned(3, spacing), 0
    wanted = _connections(reader, pose, command)
    total = sum(c.msgcount for c in wanted)
    for n, (connection, nanoseconds, raw) in enumerate(reader.messages(wanted)):
        if progress is not None and n % TELLING == 0:
            progress(n, max(total, n))
        time = nanoseconds * 1e-9
        here = (connection.topic, connection.msgtype)
        whole = pose.frames is not None  # which transforms it holds is known when it is read
        wants_pose = here == (pose.topic, pose.kind) and (whole or poses.wants(time))
        wants_command = here == (command.topic, command.kind) and commands.wants(time)
        if not wants_pose and not wants_command:
            continue
        message = decode(raw, connection.msgtype)
        if wants_pose and (found := _pose(message, pose)) is not None:
            if not all(map(isfinite, found)):
                broken += 1
            elif pose.frames is None or poses.wants(time):
                poses.add(time, *found)
        if wants_command:
            values = _command(message, command.kind)
            if all(map(isfinite, values)):
                commands.add(time, *values)
            else:
                broken += 1
    if progress is not None and total:
        progress(total, total)
    return (poses, commands), broken


def _stamp(message: Any) -> float:
    """Time of a message's header [s]; 0 if it has none or has not been set."""
    header = getattr(message, "header", None)
    return 0.0 if header is None else header.stamp.sec + 1e-9 * header.stamp.nanosec


def _pose(message: Any, wanted: Wanted) -> tuple[float, float, float, float] | None:
    """Stamp, x, y and theta; NaN without an orientation, None if TF has others only."""
    if wanted.frames is not None:
        for t in message.transforms:
            if (t.header.frame_id.strip("/"), t.child_frame_id.strip("/")) == wanted.frames:
                move = t.transform.translation
                return _stamp(t), move.x, move.y, _heading(t.transform.rotation)
        return None
    pose = message.pose if wanted.kind == POSE else message.pose.pose
    return _stamp(message), pose.position.x, pose.position.y, _heading(pose.orientation)


def _heading(q: Any) -> float:
    """Heading of the robot's x axis [rad]."""
    if q.x**2 + q.y**2 + q.z**2 + q.w**2 < 0.5:
        return float("nan")
    return float(heading_of(q.x, q.y, q.z, q.w))


def _command(message: Any, kind: str) -> tuple[float, float, float]:
    """Stamp, v and omega, or v and a steering angle."""
    if kind in STEERED:
        drive = message.drive if kind == ACKERMANN_STAMPED else message
        return _stamp(message), drive.speed, drive.steering_angle
    twist = message
    if kind == TWIST_STAMPED:
        twist = message.twist
    elif kind == ODOMETRY:
        twist = message.twist.twist
    return _stamp(message), twist.linear.x, twist.angular.z


def _series(path: Path, wanted: Wanted, samples: Thinned) -> Series:
    """Samples at their stamps where those are of the recording's clock, else as recorded."""
    rows = samples.rows()
    if len(rows) < 2:
        raise DataError(
            f"{path}: {wanted.topic}: {len(rows)} message(s) that can be used; expected at least 2"
        )
    frames = " {} -> {}".format(*wanted.frames) if wanted.frames else ""
    return Series(stamps_of(rows), rows[:, 2:], f"{wanted.topic} ({wanted.kind}{frames})")
