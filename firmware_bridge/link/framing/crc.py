"""CRC-16/XMODEM (poly 0x1021, start 0), which RoboClaw and VESC frames carry."""

from __future__ import annotations

from binascii import crc_hqx


def crc16(data: bytes, start: int = 0) -> int:
    """CRC-16/XMODEM.

    Examples
    --------
    >>> hex(crc16(b"123456789"))
    '0x31c3'
    """
    return crc_hqx(data, start)
