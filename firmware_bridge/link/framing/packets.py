"""Cutting packets out of bytes, and the CRC that many of them carry."""

from __future__ import annotations

import math
from binascii import crc_hqx
from typing import Generic, TypeVar

T = TypeVar("T")


def crc16(data: bytes | bytearray) -> int:
    """CRC-16/XMODEM (polynomial 0x1021, start 0).

    Examples
    --------
    >>> hex(crc16(b"123456789"))
    '0x31c3'
    """
    return crc_hqx(data, 0)


def with_crc(body: bytes) -> bytes:
    """Bytes and their CRC, high byte first."""
    return body + crc16(body).to_bytes(2, "big")


class Packets(Generic[T]):
    """Packets out of bytes: what is part of none is passed over."""

    gap = math.inf
    """Half a packet that is older is given up [s]."""

    def __init__(self) -> None:
        self._buffer, self._stamp = bytearray(), -math.inf
        self.bad = 0
        """Bytes passed over."""

    def reset(self) -> None:
        """Forget half a packet."""
        self.bad += len(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes, stamp: float = 0.0) -> list[T]:
        """Take bytes that came at `stamp` [s]; gives the packets that are now whole."""
        if stamp - self._stamp > self.gap:
            self.reset()
        self._stamp = stamp
        self._buffer += data
        found, at = list[T](), 0
        while at < len(self._buffer) and (cut := self._cut(self._buffer, at)) is not None:
            size, packet = cut
            at += size
            if packet is None:
                self.bad += size
            else:
                found.append(packet)
        del self._buffer[:at]
        return found

    def _cut(self, buffer: bytearray, at: int) -> tuple[int, T | None] | None:
        """Size of what begins at a place, and the packet that it is; None if more must come."""
        raise NotImplementedError
