"""Writes an MCAP file piece by piece: whatever was written before a power cut can be read.

Messages come in chunks. Each piece is whole in itself, so that a file which ends after any of them
is read up to there; what a reader needs to jump in the file follows at its end.
"""

from __future__ import annotations

import json
import struct
from collections import Counter
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple
from zlib import crc32

from kmpc_lite.learn.formats.mcap import (
    CHUNK,
    MAGIC,
    MESSAGE,
    PROFILE,
    Op,
    counts,
    record,
    table,
    text,
)


class Topic(NamedTuple):
    """A stream of messages of one kind."""

    name: str
    schema: str
    """Name of its kind, ``foxglove.PoseInFrame``."""
    description: Mapping[str, Any]
    """Its JSON schema."""


class Message(NamedTuple):
    """One message of a topic."""

    topic: str
    time: int
    """[ns]"""
    content: Mapping[str, Any]
    """What JSON can hold."""


class McapWriter:
    """Makes the bytes of a file; the caller writes them, in order and each piece whole.

    Parameters
    ----------
    topics : iterable of Topic
        All that messages will be of.
    """

    def __init__(self, topics: Iterable[Topic]) -> None:
        self._topics = list(topics)
        self._channels = {topic.name: k for k, topic in enumerate(self._topics, start=1)}
        self._kinds = {topic.schema: topic.description for topic in self._topics}
        self._schema_ids = {name: k for k, name in enumerate(self._kinds, start=1)}
        self._place = 0
        self._chunks: list[bytes] = []
        self._metadata: list[bytes] = []
        self._counts: Counter[int] = Counter()
        self._first: int | None = None
        self._last = 0

    def begin(self, library: str) -> bytes:
        """Give the beginning of the file."""
        header = record(Op.HEADER, text(PROFILE) + text(library))
        return self._placed(MAGIC + header + self._descriptions())

    def metadata(self, name: str, entries: Mapping[str, str]) -> bytes:
        """Give a piece with texts about the whole file."""
        piece = record(Op.METADATA, text(name) + table(entries))
        index = struct.pack("<QQ", self._place, len(piece)) + text(name)
        self._metadata.append(record(Op.METADATA_INDEX, index))
        return self._placed(piece)

    def chunk(self, messages: Iterable[Message]) -> bytes:
        """Give a piece with messages; none if there are none."""
        ordered = sorted(messages, key=lambda message: message.time)
        if not ordered:
            return b""
        first, last = ordered[0].time, ordered[-1].time
        records, places = bytearray(), dict[int, bytearray]()
        for message in ordered:
            channel = self._channels[message.topic]
            places.setdefault(channel, bytearray()).extend(
                struct.pack("<QQ", message.time, len(records))
            )
            self._counts[channel] += 1
            head = MESSAGE.pack(channel, self._counts[channel], message.time, message.time)
            records += record(Op.MESSAGE, head + _json(message.content))
        head = CHUNK.pack(first, last, len(records), crc32(records)) + text("")
        chunk = record(Op.CHUNK, head + struct.pack("<Q", len(records)) + records)
        indexes, offsets = b"", {}
        for channel, listed in places.items():
            offsets[channel] = self._place + len(chunk) + len(indexes)
            head = struct.pack("<HI", channel, len(listed))
            indexes += record(Op.MESSAGE_INDEX, head + listed)
        index = struct.pack("<QQQQ", first, last, self._place, len(chunk)) + counts(offsets)
        sizes = text("") + struct.pack("<QQ", len(records), len(records))
        index += struct.pack("<Q", len(indexes)) + sizes
        self._chunks.append(record(Op.CHUNK_INDEX, index))
        self._first = first if self._first is None else min(self._first, first)
        self._last = max(self._last, last)
        return self._placed(chunk + indexes)

    def end(self) -> bytes:
        """Give the end of the file: what a reader needs to jump in it."""
        data_end = record(Op.DATA_END, struct.pack("<I", 0))
        start = self._place + len(data_end)
        groups = (
            (Op.SCHEMA, self._schemas()),
            (Op.CHANNEL, self._listed_channels()),
            (Op.STATISTICS, self._statistics()),
            (Op.CHUNK_INDEX, b"".join(self._chunks)),
            (Op.METADATA_INDEX, b"".join(self._metadata)),
        )
        summary, offsets = b"", b""
        for op, group in groups:
            if group:
                place = struct.pack("<BQQ", op, start + len(summary), len(group))
                offsets += record(Op.SUMMARY_OFFSET, place)
                summary += group
        footer = struct.pack("<QQ", start, start + len(summary))
        head = struct.pack("<BQ", Op.FOOTER, len(footer) + 4)
        checked = summary + offsets + head + footer
        return self._placed(data_end + checked + struct.pack("<I", crc32(checked)) + MAGIC)

    def _placed(self, piece: bytes) -> bytes:
        self._place += len(piece)
        return piece

    def _descriptions(self) -> bytes:
        return self._schemas() + self._listed_channels()

    def _schemas(self) -> bytes:
        found = b""
        for name, description in self._kinds.items():
            data = _json(description)
            head = struct.pack("<H", self._schema_ids[name]) + text(name) + text("jsonschema")
            found += record(Op.SCHEMA, head + struct.pack("<I", len(data)) + data)
        return found

    def _listed_channels(self) -> bytes:
        found = b""
        for topic in self._topics:
            ids = struct.pack("<HH", self._channels[topic.name], self._schema_ids[topic.schema])
            found += record(Op.CHANNEL, ids + text(topic.name) + text("json") + table({}))
        return found

    def _statistics(self) -> bytes:
        numbers = struct.pack(
            "<QHIIIIQQ",
            self._counts.total(),
            len(self._kinds),
            len(self._topics),
            0,
            len(self._metadata),
            len(self._chunks),
            self._first or 0,
            self._last,
        )
        return record(Op.STATISTICS, numbers + counts(self._counts))


def _json(content: Any) -> bytes:
    """JSON without NaN, which it does not know."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
