"""Drives that kmpc recorded itself, MCAP files that the mcap package reads, without trusting them.

A file that a power cut tore is read up to its last whole record. Chunks that are packed, or of
other profiles, are for other readers.
"""

from __future__ import annotations

import json
import os
import struct
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from math import atan2, remainder, tau
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.streams import Thinned, two_or_three
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic
from kmpc_lite.reading import open_regular

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of a file
PROFILE = "kmpc"  # profile of the files that this project writes
DRIVE = "drive.mcap"  # name of a recorded drive in its folder
LARGEST_MESSAGE, LARGEST = 2**20, 2**25
"""Length of the longest message that this project writes, and of the largest record that is read
[bytes]; a chunk holds half a second."""
MOST_CHANNELS = 1000
POSES, COMMANDS, GATE = "/pose", "/command", "/gate"
DRIVING = ("ACTIVE", "STOPPING", "HOLDING")
"""States of the safety gate in which the robot obeys the commands that are recorded."""
BREAKS = 0.3  # where the robot did not obey, poses are left out, and so is this long after it [s]


class Found(NamedTuple):
    """One message of a file, or one table of texts."""

    topic: str  # of the message; the table's name behind ``metadata:``
    time: int  # [ns]
    content: Any  # bytes of a message, or texts by their names


def is_ours(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as one of this project does."""
    with suppress(OSError, ValueError), open_regular(path) as file:
        begin = file.read(len(MAGIC) + 13 + len(PROFILE))
        profile = struct.pack("<I", len(PROFILE)) + PROFILE.encode()
        return begin.startswith(MAGIC + b"\x01") and begin.endswith(profile)
    return False


class _Bounded:
    """A file of which no more is read at once than a record may hold, whatever a length says."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, LARGEST))


def read_messages(file: BinaryIO) -> Iterator[Found]:
    """Yield all that is in an open file, in its order, as far as it is whole.

    Raises ValueError for whatever is wrong with its content, in one line.
    """
    from mcap import records as of

    topics: dict[int, str] = {}
    records = _records(file)
    if not isinstance(header := next(records, None), of.Header):
        raise ValueError("not an MCAP file")
    if header.profile != PROFILE:
        raise ValueError(f"expected an MCAP file of kmpc, got the profile {header.profile!r:.40}")
    for record in records:
        if isinstance(record, of.Channel):
            topics[record.id] = record.topic
            if len(topics) > MOST_CHANNELS:
                raise ValueError(f"more than {MOST_CHANNELS} channels")
        elif isinstance(record, of.Metadata):
            yield Found(f"metadata:{record.name}", 0, record.metadata)
        elif isinstance(record, of.Message):
            if record.channel_id not in topics:
                raise ValueError(f"a message of channel {record.channel_id}, not announced")
            yield Found(topics[record.channel_id], record.log_time, record.data)


def _records(file: BinaryIO) -> Iterator[Any]:
    """Yield records, those of chunks among them, until the data end or are torn."""
    from mcap.exceptions import McapError
    from mcap.records import Chunk, DataEnd
    from mcap.stream_reader import StreamReader, breakup_chunk

    bounded: Any = _Bounded(file)
    reader = StreamReader(bounded, emit_chunks=True, record_size_limit=LARGEST)
    with suppress(McapError, struct.error, UnicodeDecodeError):  # torn: what comes before is whole
        for record in reader.records:
            if isinstance(record, DataEnd):
                return
            if not isinstance(record, Chunk):
                yield record
                continue
            if record.compression:
                raise ValueError(f"a chunk is packed with {record.compression!r:.20}")
            try:
                parts = breakup_chunk(record, validate_crc=True)
            except (McapError, struct.error, UnicodeDecodeError) as error:
                raise ValueError(f"a chunk is damaged: {type(error).__name__}") from error
            yield from parts


def read_recorded(path: Path, options: ReadOptions) -> Log:
    """Read poses and commands of a recorded drive, as far as the robot obeyed them."""
    if options.topics:
        raise DataError(f"{path}: --topics: a drive that kmpc recorded has one pose, one command")
    kept = {POSES: Thinned(3, options.spacing), COMMANDS: Thinned(3, options.spacing)}
    counts, obeys, since, left_out = Counter[str](), True, -BREAKS, 0
    try:
        with open_regular(path) as file:
            for topic, nanoseconds, content in read_messages(file):
                if topic.startswith("metadata:"):
                    continue
                counts[topic] += 1
                time = nanoseconds * 1e-9
                if topic != GATE and not (topic in kept and kept[topic].wants(time)):
                    continue
                told = _parsed(topic, content)
                if topic == GATE:
                    before, obeys = obeys, told["state"] in DRIVING
                    since = time if obeys and not before else since
                elif topic == COMMANDS:
                    speeds = told["v"], told.get("vy", 0.0), told["omega"]
                    kept[topic].add(time, *map(_number, speeds))
                elif obeys and time >= since + BREAKS:
                    place, turn = told["pose"]["position"], told["pose"]["orientation"]
                    x, y, sin, cos = map(_number, (place["x"], place["y"], turn["z"], turn["w"]))
                    kept[topic].add(time, x, y, remainder(2.0 * atan2(sin, cos), tau))
                else:
                    left_out += 1
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DataError(f"{path}: not a drive that kmpc recorded: {error!s:.200}") from error
    series = []
    for name, samples in kept.items():
        if len(rows := samples.rows()) < 2:
            raise DataError(f"{path}: {name}: {len(rows)} message(s); expected at least 2")
        series.append(Series(rows[:, 0], rows[:, 1:], f"{name} (kmpc)"))
    notes = [f"poses: {series[0].source}; commands: {series[1].source}"]
    if left_out:
        notes.append(f"{left_out} poses of a robot that did not obey were left out")
    topics = tuple(Topic(name, "kmpc", count, None) for name, count in sorted(counts.items()))
    log = Log(str(path), series[0], series[1], topics=topics, notes=tuple(notes))
    return two_or_three(replace(log, columns=("v", "lateral", "omega")))


def _parsed(topic: str, content: bytes) -> Any:
    if len(content) > LARGEST_MESSAGE:
        raise ValueError(f"a message of {len(content):,} bytes on {topic}")
    return json.loads(content)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a number, got {value!r:.40}")
    return float(value)
