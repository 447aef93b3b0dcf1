"""Frames without zeros (COBS) that end in one, with CRC-16 inside."""

from __future__ import annotations

from firmware_bridge.link.framing.packets import crc16, with_crc

RUN = 254
"""Bytes without a zero that one code byte covers."""


def cobs_frame(body: bytes) -> bytes:
    r"""Build a frame: body and its CRC, high byte first, without zeros; a zero ends it.

    Examples
    --------
    >>> cobs_frame(b"\x01\x0a").hex(" ")
    '05 01 0a 92 7b 00'
    """
    frame = bytearray()
    *blocks, last = with_crc(body).split(b"\0")
    for block in (*blocks, last):
        while len(block) >= RUN:
            frame += b"\xff" + block[:RUN]
            block = block[RUN:]
        frame += bytes((len(block) + 1,)) + block
    if last and len(last) % RUN == 0:
        del frame[-1]  # a full run that ends the frame has nothing behind it
    return bytes(frame + b"\0")


def cobs_body(frame: bytes) -> bytes | None:
    """Body of a frame without its end; None for a damaged one."""
    body, at = bytearray(), 0
    while at < len(frame):
        run = frame[at]
        if run == 0 or at + run > len(frame):
            return None
        body += frame[at + 1 : at + run]
        at += run
        if run <= RUN and at < len(frame):
            body += b"\0"
    return bytes(body[:-2]) if len(body) >= 2 and crc16(body) == 0 else None


class CobsFrames:
    """Cuts bytes into frames, and gives the bodies of whole ones.

    `longest`: longer frames are dropped up to their end [bytes].
    """

    def __init__(self, longest: int) -> None:
        self._longest, self._rest = longest, b""
        self.bad = 0
        """Frames that were damaged, or too long."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; returns the bodies of the frames that end in them."""
        *frames, rest = (self._rest + data).split(b"\0")
        self._rest = rest[: self._longest + 1]  # one that is too long stays too long
        bodies = [cobs_body(f) if len(f) <= self._longest else None for f in frames if f]
        found = [body for body in bodies if body is not None]
        self.bad += len(bodies) - len(found)
        return found
