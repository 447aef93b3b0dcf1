"""Frames of VESC boards."""

from __future__ import annotations

from firmware_bridge.link.framing.packets import Packets, crc16, with_crc

SHORT, LONG, STOP = 0x02, 0x03, 0x03


def vesc_packet(payload: bytes) -> bytes:
    """Build a frame: 02 length8 or 03 length16, payload, CRC, 03.

    Examples
    --------
    >>> vesc_packet(bytes([4])).hex(" ")
    '02 01 04 40 84 03'
    """
    size = len(payload)
    head = bytes((SHORT, size)) if size < 256 else bytes((LONG,)) + size.to_bytes(2, "big")
    return head + with_crc(payload) + bytes((STOP,))


class VescPackets(Packets[bytes]):
    """Payloads out of bytes; a frame that claims to be longer than `most` is none."""

    gap = 0.1

    def __init__(self, most: int = 512) -> None:
        super().__init__()
        self._most = most

    def _cut(self, buffer: bytearray, at: int) -> tuple[int, bytes | None] | None:
        if buffer[at] not in (SHORT, LONG):
            return 1, None
        head = at + (2 if buffer[at] == SHORT else 3)
        size = int.from_bytes(buffer[at + 1 : head], "big")
        if head > len(buffer):
            return None
        if not 1 <= size <= self._most:
            return 1, None
        stop = head + size + 2
        if stop >= len(buffer):
            return None
        payload = bytes(buffer[head : stop - 2])
        whole = buffer[stop] == STOP and crc16(buffer[head:stop]) == 0
        return (stop + 1 - at, payload) if whole else (1, None)
