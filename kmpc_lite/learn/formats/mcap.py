"""MCAP files of this project: how they are laid out, and how they are read without trusting them.

The specification: https://mcap.dev/spec. All numbers are little-endian. A file that a power cut
tore is read up to its last whole chunk. Chunks that are packed, or of other profiles, are for other
readers.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from enum import IntEnum
from typing import Any, BinaryIO, NamedTuple
from zlib import crc32

from kmpc_lite.reading import open_regular

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a file."""
PROFILE = "kmpc"
"""Profile of the files that this project writes."""

DRIVE = "drive.mcap"
"""Name of a recorded drive in its folder."""
LARGEST_MESSAGE = 2**20
"""Length of the longest message that this project writes [bytes]."""


class Op(IntEnum):
    """Kinds of records, by their first byte."""

    HEADER = 1
    FOOTER = 2
    SCHEMA = 3
    CHANNEL = 4
    MESSAGE = 5
    CHUNK = 6
    MESSAGE_INDEX = 7
    CHUNK_INDEX = 8
    STATISTICS = 11
    METADATA = 12
    METADATA_INDEX = 13
    SUMMARY_OFFSET = 14
    DATA_END = 15


RECORD = struct.Struct("<BQ")
"""Kind and length of a record; its content follows."""
MESSAGE = struct.Struct("<HIQQ")
"""Channel, number, and twice the time of a message [ns]; its data follow."""
CHUNK = struct.Struct("<QQQI")
"""First and last time [ns], size and checksum; the name of the compression and the records
follow."""


def record(op: Op, content: bytes) -> bytes:
    """Make a whole record."""
    return RECORD.pack(op, len(content)) + content


def text(words: str) -> bytes:
    """Make a text: its length in bytes, then its bytes."""
    data = words.encode()
    return struct.pack("<I", len(data)) + data


def table(entries: Mapping[str, str]) -> bytes:
    """Make a map of texts."""
    data = b"".join(text(key) + text(value) for key, value in entries.items())
    return struct.pack("<I", len(data)) + data


def counts(entries: Mapping[int, int]) -> bytes:
    """Make a map of channels to numbers."""
    data = b"".join(struct.pack("<HQ", channel, count) for channel, count in entries.items())
    return struct.pack("<I", len(data)) + data


LARGEST = 2**25
"""Largest record that is read [bytes]; a chunk holds half a second."""
MOST_CHANNELS = 1000


class Channel(NamedTuple):
    """A stream of messages."""

    topic: str
    encoding: str
    """Of its messages: ``json``."""


class Found(NamedTuple):
    """One message of a file, or one table of texts."""

    topic: str
    """Of the message; the table's name behind ``metadata:``."""
    time: int
    """[ns]"""
    content: Any
    """Bytes of a message, or texts by their names."""


class Torn(Exception):
    """A record is not whole."""


def is_ours(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as one of this project does."""
    with suppress(OSError, Torn, ValueError), open_regular(path) as file:
        return _profile(file) == PROFILE
    return False


def read_mcap(path: str | os.PathLike[str]) -> Iterator[Found]:
    """Yield all that is in a file, in its order, as far as it is whole.

    Raises
    ------
    OSError
        If it cannot be read.
    ValueError
        For whatever is wrong with its content, in one line.
    """
    with open_regular(path) as file:
        yield from read_messages(file)


def read_messages(file: BinaryIO) -> Iterator[Found]:
    """Yield all that is in an open file; raises ValueError as `read_mcap` does."""
    try:
        if (profile := _profile(file)) != PROFILE:
            raise ValueError(f"expected an MCAP file of kmpc, got the profile {profile!r:.40}")
    except Torn:
        raise ValueError("not an MCAP file") from None
    channels: dict[int, Channel] = {}
    with suppress(Torn):  # what comes before is whole
        while True:
            op, content = _record(file)
            if op == Op.DATA_END:
                return
            yield from _found(op, content, channels)


def _profile(file: BinaryIO) -> str:
    """Read the magic and the header."""
    if file.read(len(MAGIC)) != MAGIC:
        raise ValueError("not an MCAP file")
    op, content = _record(file)
    if op != Op.HEADER:
        raise ValueError("an MCAP file without a header")
    return _Parts(content).text()


def _record(file: BinaryIO) -> tuple[int, bytes]:
    """Read a record."""
    head = file.read(RECORD.size)
    if len(head) < RECORD.size:
        raise Torn
    op, length = RECORD.unpack(head)
    if length > LARGEST:
        # behind a torn piece there may be anything; a record of this size is none of ours
        raise Torn
    content = file.read(length)
    if len(content) < length:
        raise Torn
    return op, content


def _found(op: int, content: bytes, channels: dict[int, Channel]) -> Iterator[Found]:
    """Take in a record, and yield what it holds."""
    match op:
        case Op.CHANNEL:
            number, channel = _channel(content)
            if len(channels) >= MOST_CHANNELS:
                raise ValueError(f"more than {MOST_CHANNELS} channels")
            channels[number] = channel
        case Op.METADATA:
            parts = _Parts(content)
            yield Found(f"metadata:{parts.text()}", 0, parts.table())
        case Op.MESSAGE:
            yield _message(content, channels)
        case Op.CHUNK:
            yield from _chunk(content, channels)


def _chunk(content: bytes, channels: dict[int, Channel]) -> Iterator[Found]:
    """Yield the messages of a chunk."""
    parts = _Parts(content)
    _, _, size, checksum = CHUNK.unpack(parts.take(CHUNK.size))
    if packed := parts.text():
        raise ValueError(f"a chunk is packed with {packed!r:.20}; expected none that is")
    records = parts.take(parts.number("<Q"))
    if len(records) != size or (checksum and crc32(records) != checksum):
        raise ValueError("a chunk is damaged: its checksum is another")
    parts = _Parts(records)
    while parts.left:
        op, length = RECORD.unpack(parts.take(RECORD.size))
        if op == Op.CHUNK:
            raise ValueError("a chunk within a chunk")
        yield from _found(op, parts.take(length), channels)


def _message(content: bytes, channels: dict[int, Channel]) -> Found:
    if len(content) < MESSAGE.size:
        raise ValueError("a message that is too short")
    channel, _, time, _ = MESSAGE.unpack_from(content)
    if channel not in channels:
        raise ValueError(f"a message of channel {channel}, which was not announced")
    return Found(channels[channel].topic, time, content[MESSAGE.size :])


def _channel(content: bytes) -> tuple[int, Channel]:
    parts = _Parts(content)
    number, _ = struct.unpack("<HH", parts.take(4))
    return number, Channel(parts.text(), parts.text())


class _Parts:
    """What a record is made of, one part after the other; ValueError where it ends too soon."""

    def __init__(self, content: bytes) -> None:
        self._content, self._place = content, 0

    @property
    def left(self) -> int:
        """Bytes that are left."""
        return len(self._content) - self._place

    def take(self, size: int) -> bytes:
        """Give the next bytes."""
        if size > self.left:
            raise ValueError("a record that ends too soon")
        self._place += size
        return self._content[self._place - size : self._place]

    def number(self, kind: str) -> int:
        """Give the next number."""
        return int(struct.unpack(kind, self.take(struct.calcsize(kind)))[0])

    def text(self) -> str:
        """Give the next text."""
        return self.take(self.number("<I")).decode("utf-8", "replace")

    def table(self) -> dict[str, str]:
        """Give the next map of texts."""
        inside, found = _Parts(self.take(self.number("<I"))), {}
        while inside.left:
            key = inside.text()
            found[key] = inside.text()
        return found
