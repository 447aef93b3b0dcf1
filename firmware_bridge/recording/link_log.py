"""The frames of an autopilot's link, both ways: recorded between driver and transport.

They make a tlog (before each frame its time, big-endian uint64 microseconds since 1970), which
MAVProxy, QGroundControl and mavlogdump read.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

from firmware_bridge.link import OnBytes, Transport
from firmware_bridge.recording.durable import DurableFile

TLOG_STAMP = struct.Struct(">Q")


class Chunk(NamedTuple):
    """Bytes that passed at one time."""

    time: float  # of `time.monotonic` [s]
    incoming: bool  # from the board
    data: bytes


class RecordedTransport:
    """A transport that shows a log all that passes through it.

    `transport`: the link. `log`: takes chunks with times of `time.monotonic()`; must return at
    once.
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
            frames = codec.frames(chunk.data, chunk.time) if chunk.incoming else [chunk.data]
            stamp = TLOG_STAMP.pack(int((chunk.time + unix) * 1e6))
            parts += [stamp + frame for frame in frames]
        return parts

    return DurableFile(path, encode)
