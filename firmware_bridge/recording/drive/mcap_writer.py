"""Writes an MCAP file piece by piece: whatever was written before a power cut can be read.

Messages come in chunks. Each piece is whole in itself, so that a file which ends after any of them
is read up to there; what a reader needs to jump in the file follows at its end.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

from kmpc_lite.learn.formats.mcap import LARGEST, PROFILE


class Topic(NamedTuple):
    """A stream of messages of one kind."""

    name: str
    schema: str  # name of its kind, ``foxglove.PoseInFrame``
    description: Mapping[str, Any]  # its JSON schema


class Message(NamedTuple):
    """One message of a topic."""

    topic: str
    time: int  # [ns]
    content: Mapping[str, Any]  # what JSON can hold


class _Pieces:
    """A file whose bytes are taken piece by piece."""

    def __init__(self) -> None:
        self._place, self._new = 0, b""

    def write(self, data: bytes) -> int:
        self._place, self._new = self._place + len(data), self._new + data
        return len(data)

    def tell(self) -> int:
        return self._place

    def flush(self) -> None:
        """All is there already."""

    def taken(self) -> bytes:
        """What was written since this was asked before."""
        new, self._new = self._new, b""
        return new


class McapWriter:
    """Makes the bytes of a file; the caller writes them, in order and each piece whole.

    `topics`: all that messages will be of.
    """

    def __init__(self, topics: Iterable[Topic]) -> None:
        from mcap.writer import CompressionType, Writer

        self._topics, self._out = list(topics), _Pieces()
        out: Any = self._out
        self._writer: Any = Writer(out, chunk_size=LARGEST, compression=CompressionType.NONE)
        self._channels: dict[str, int] = {}

    def begin(self, library: str) -> bytes:
        """Give the beginning of the file."""
        self._writer.start(PROFILE, library)
        kinds = {topic.schema: topic.description for topic in self._topics}
        register, channel = self._writer.register_schema, self._writer.register_channel
        schemas = {kind: register(kind, "jsonschema", _json(told)) for kind, told in kinds.items()}
        self._channels = {t.name: channel(t.name, "json", schemas[t.schema]) for t in self._topics}
        return self._piece()

    def metadata(self, name: str, entries: Mapping[str, str]) -> bytes:
        """Give a piece with texts about the whole file."""
        self._writer.add_metadata(name, dict(entries))
        return self._piece()

    def chunk(self, messages: Iterable[Message]) -> bytes:
        """Give a piece with messages; none if there are none."""
        listed = [(m, _json(m.content)) for m in sorted(messages, key=lambda m: m.time)]
        for message, data in listed:
            self._writer.add_message(
                self._channels[message.topic], message.time, data, message.time
            )
        return self._piece()

    def end(self) -> bytes:
        """Give the end of the file: what a reader needs to jump in it."""
        self._writer.finish()
        return self._out.taken()

    def _piece(self) -> bytes:
        self._writer.flush()
        return self._out.taken()


def _json(content: Any) -> bytes:
    """JSON without NaN, which it does not know."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
