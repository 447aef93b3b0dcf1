"""How an MCAP file is laid out: its magic, its kinds of records, and the parts of these.

The specification: https://mcap.dev/spec. All numbers are little-endian.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from enum import IntEnum

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
