"""The frames of an autopilot's link, both ways: recorded between driver and transport, and read.

They make a tlog (before each frame its time, big-endian uint64 microseconds since 1970), which
MAVProxy, QGroundControl and mavlogdump read.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import NamedTuple

from firmware_bridge.link import OnBytes, Transport
from firmware_bridge.messages import ConfigError
from firmware_bridge.recording.durable import DurableFile
from kmpc_lite.reading import read_bytes

TLOG_STAMP = struct.Struct(">Q")
MAX_BYTES, MAX_RECORDS = 2**28, 2**22
"""Of the longest log that is read: it is held in memory."""
V1, V2, SIGNED = 0xFE, 0xFD, 1
"""First bytes of MAVLink frames, and the flag of a signed one."""


class Chunk(NamedTuple):
    """Bytes that passed at one time."""

    time: float
    """[s], of whatever clock the log has."""
    incoming: bool | None
    """From the board; None if the log does not tell."""
    data: bytes


class RecordedTransport:
    """A transport that shows a log all that passes through it.

    Parameters
    ----------
    transport : Transport
        The link.
    log : callable
        Takes chunks with times of `time.monotonic()`; must return at once.
    """

    def __init__(self, transport: Transport, log: Callable[[Chunk], None]) -> None:
        self._transport, self._log = transport, log

    def start(self, on_bytes: OnBytes) -> None:
        """Open the link."""

        def both(data: bytes, stamp: float) -> None:
            self._log(Chunk(stamp, True, data))
            on_bytes(data, stamp)

        self._transport.start(both)

    def write(self, data: bytes) -> bool:
        """Send one frame; logged if the link takes it."""
        taken = self._transport.write(data)
        if taken:
            self._log(Chunk(time.monotonic(), False, bytes(data)))
        return taken

    @property
    def connected(self) -> bool:
        """Whether the link is open."""
        return self._transport.connected

    @property
    def counters(self) -> dict[str, int]:
        """Counters of the link."""
        return self._transport.counters

    @property
    def last_error(self) -> str:
        """Why the link last went down."""
        return self._transport.last_error

    def close(self) -> None:
        """Close the link."""
        self._transport.close()


def tlog(path: Path) -> DurableFile[Chunk]:
    """Start a tlog in a new file; whole frames only, noise on the line is left out."""
    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec

    # Unix time as the format wants it, taken once: the log must not jump with the wall clock
    codec, unix = MavlinkCodec(255, 190), time.time() - time.monotonic()

    def encode(chunks: Iterable[Chunk]) -> list[bytes]:
        parts: list[bytes] = []
        for chunk in chunks:
            frames = (
                [bytes(frame) for frame in codec.frames(chunk.data, chunk.time)]
                if chunk.incoming
                else [chunk.data]
            )
            stamp = TLOG_STAMP.pack(int((chunk.time + unix) * 1e6))
            parts += [stamp + frame for frame in frames]
        return parts

    return DurableFile(path, encode)


def read_link_log(path: Path) -> Iterator[Chunk]:
    """Read a tlog; a record that a power cut tore off the end is left out.

    Raises
    ------
    ConfigError
        For a file that is missing, too long, or none.
    """
    try:
        content = read_bytes(path, MAX_BYTES)
    except OSError as error:
        raise ConfigError(f"{path}: cannot read: {error.strerror or error}") from error
    if len(content) > TLOG_STAMP.size and content[TLOG_STAMP.size] in (V1, V2):
        return _at_most(MAX_RECORDS, _read_tlog(content, path), path)
    raise ConfigError(f"{path}: expected a tlog")


def _at_most(most: int, chunks: Iterator[Chunk], path: Path) -> Iterator[Chunk]:
    for number, chunk in enumerate(chunks):
        if number >= most:
            raise ConfigError(f"{path}: more than {most:,} records: cut the log")
        yield chunk


def _read_tlog(content: bytes, path: Path) -> Iterator[Chunk]:
    at = 0
    while at + TLOG_STAMP.size + 10 <= len(content):
        (stamp,) = TLOG_STAMP.unpack_from(content, at)
        start = at + TLOG_STAMP.size
        magic, length, flags = content[start : start + 3]
        if magic not in (V1, V2):
            raise ConfigError(
                f"{path}: byte {start}: expected a MAVLink frame, got {magic:#04x}: damaged"
            )
        size = 8 + length if magic == V1 else 12 + length + (13 if flags & SIGNED else 0)
        at = start + size
        if at > len(content):
            return
        yield Chunk(stamp * 1e-6, None, content[start:at])
