"""Frames of VESC boards."""

from __future__ import annotations

from firmware_bridge.link.framing.crc import crc16

VESC_SHORT, VESC_LONG, VESC_STOP = 0x02, 0x03, 0x03
VESC_GAP = 0.1
"""Half a frame that is older is given up [s]."""


def vesc_packet(payload: bytes) -> bytes:
    """Build a frame: 02 length8 or 03 length16, payload, CRC, 03.

    Examples
    --------
    >>> vesc_packet(bytes([4])).hex(" ")
    '02 01 04 40 84 03'
    """
    size = len(payload)
    head = (
        bytes((VESC_SHORT, size)) if size < 256 else bytes((VESC_LONG,)) + size.to_bytes(2, "big")
    )
    return head + payload + crc16(payload).to_bytes(2, "big") + bytes((VESC_STOP,))


class VescPackets:
    """Payloads out of bytes.

    Parameters
    ----------
    max_payload : int
        A frame that claims more is no frame.
    """

    def __init__(self, max_payload: int = 512) -> None:
        self._max = max_payload
        self._buffer = bytearray()
        self._stamp = -float("inf")
        self.bad = 0
        """Bytes skipped."""

    def reset(self) -> None:
        """Forget half a frame."""
        self.bad += len(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes, stamp: float) -> list[bytes]:
        """Take bytes that came at `stamp` [s]; returns the payload of each whole frame."""
        if stamp - self._stamp > VESC_GAP:
            self.reset()
        self._stamp = stamp
        self._buffer += data
        found: list[bytes] = []
        at, end = 0, len(self._buffer)
        while at < end:
            head = 2 if self._buffer[at] == VESC_SHORT else 3
            if self._buffer[at] not in (VESC_SHORT, VESC_LONG):
                at += 1
                self.bad += 1
                continue
            if at + head > end:
                break
            size = int.from_bytes(self._buffer[at + 1 : at + head], "big")
            if not 1 <= size <= self._max:
                at += 1
                self.bad += 1
                continue
            stop = at + head + size + 2
            if stop >= end:
                break
            payload = bytes(self._buffer[at + head : at + head + size])
            if self._buffer[stop] == VESC_STOP and crc16(payload) == int.from_bytes(
                self._buffer[stop - 2 : stop], "big"
            ):
                found.append(payload)
                at = stop + 1
            else:
                at += 1
                self.bad += 1
        del self._buffer[:at]
        return found
