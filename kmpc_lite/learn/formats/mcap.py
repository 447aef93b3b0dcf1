"""MCAP files of this project, read by the mcap package without trusting them.

A file that a power cut tore is read up to its last whole record. Chunks that are packed, or of
other profiles, are for other readers.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, BinaryIO, NamedTuple

from kmpc_lite.reading import open_regular

MAGIC = b"\x89MCAP0\r\n"
"""First and last bytes of a file."""
PROFILE = "kmpc"
"""Profile of the files that this project writes."""
DRIVE = "drive.mcap"
"""Name of a recorded drive in its folder."""
LARGEST_MESSAGE, LARGEST = 2**20, 2**25
"""Length of the longest message that this project writes, and of the largest record that is read
[bytes]; a chunk holds half a second."""
MOST_CHANNELS = 1000


class Found(NamedTuple):
    """One message of a file, or one table of texts."""

    topic: str
    """Of the message; the table's name behind ``metadata:``."""
    time: int
    """[ns]"""
    content: Any
    """Bytes of a message, or texts by their names."""


def is_ours(path: str | os.PathLike[str]) -> bool:
    """Whether a file begins as one of this project does."""
    with suppress(OSError, ValueError), open_regular(path) as file:
        begin = file.read(len(MAGIC) + 13 + len(PROFILE))
        profile = struct.pack("<I", len(PROFILE)) + PROFILE.encode()
        return begin.startswith(MAGIC + b"\x01") and begin.endswith(profile)
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


class _Bounded:
    """A file of which no more is read at once than a record may hold, whatever a length says."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        return self._file.read(min(size, LARGEST))


def read_messages(file: BinaryIO) -> Iterator[Found]:
    """Yield all that is in an open file; raises ValueError as `read_mcap` does."""
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
