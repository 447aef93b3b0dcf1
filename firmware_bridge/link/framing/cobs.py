"""Frames without zeros (COBS) that end in one, with CRC-16 inside."""

from __future__ import annotations

from firmware_bridge.link.framing.crc import crc16

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
    blocks = (body + crc16(body).to_bytes(2, "big")).split(b"\0")
    for number, block in enumerate(blocks):
        while len(block) >= RUN:
            frame += b"\xff" + block[:RUN]
            block = block[RUN:]
            if not block and number + 1 == len(blocks):
                return bytes(frame + b"\0")
        frame += bytes((len(block) + 1,)) + block
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
    if len(body) < 2 or crc16(bytes(body)) != 0:
        return None
    return bytes(body[:-2])


class CobsFrames:
    """Cuts bytes into frames, and gives the bodies of whole ones.

    Parameters
    ----------
    longest : int
        Longer frames are dropped up to their end [bytes].
    """

    def __init__(self, longest: int) -> None:
        self._longest = longest
        self._buffer = bytearray()
        self._dropping = False
        self.bad = 0
        """Frames that were damaged, or too long."""

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; returns the bodies of the frames that end in them."""
        found = []
        *whole, rest = data.split(b"\0")
        for part in whole:
            frame = bytes(self._buffer) + part
            self._buffer.clear()
            good = not self._dropping and len(frame) <= self._longest
            self._dropping = False
            body = cobs_body(frame) if good else None
            if body is not None:
                found.append(body)
            elif frame or not good:
                self.bad += 1
        self._buffer += rest
        if len(self._buffer) > self._longest:
            self._buffer.clear()
            self._dropping = True
        return found
