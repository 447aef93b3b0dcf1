"""Packets of RoboClaw boards, in packet serial mode."""

from __future__ import annotations

from collections.abc import Mapping

from firmware_bridge.link.framing.packets import Packets, crc16, with_crc

ACK = 0xFF
DEEPEST = 128
"""An answer that lies deeper in noise than this is not looked for [bytes]."""


def roboclaw_packet(address: int, command: int, payload: bytes = b"") -> bytes:
    """Build a packet that writes: address, command, payload, CRC; the board answers 0xFF.

    Examples
    --------
    >>> roboclaw_packet(0x80, 14, bytes([3])).hex(" ")
    '80 0e 03 28 36'
    """
    return with_crc(bytes((address, command)) + payload)


def roboclaw_request(address: int, command: int) -> bytes:
    """Build a packet that reads: it carries no CRC."""
    return bytes((address, command))


def roboclaw_reply(address: int, command: int, payload: bytes) -> bytes:
    """Build the board's answer to a read: the CRC covers address and command too."""
    return with_crc(bytes((address, command)) + payload)[2:]


class RoboClawReplies:
    """Finds the answer to the request under way: answers carry no header of their own."""

    def __init__(self) -> None:
        self._buffer, self._head = bytearray(), b""
        self._sizes: tuple[int, ...] = ()
        self.bad = 0
        """Bytes skipped as part of no answer."""

    def expect(self, address: int, command: int, *sizes: int) -> None:
        """Wait for this command's answer, of one of these payload sizes; 0 is the bare 0xFF."""
        self._skip(len(self._buffer))
        self._head, self._sizes = bytes((address, command)), sizes

    def feed(self, data: bytes) -> bytes | None:
        """Take bytes; returns the payload of the answer once, then nothing until `expect`."""
        self._buffer += data
        self._skip(len(self._buffer) - DEEPEST)
        for start in range(len(self._buffer) if self._sizes else 0):
            if (payload := self._match(start)) is not None:
                self._skip(start)
                del self._buffer[: len(payload) + 2 if payload else 1]
                self._sizes = ()
                return payload
        self._skip(len(self._buffer) - max(0, max(self._sizes, default=-2) + 1))
        return None

    def _skip(self, count: int) -> None:
        self.bad += max(0, count)
        del self._buffer[: max(0, count)]

    def _match(self, start: int) -> bytes | None:
        for size in self._sizes:
            payload = bytes(self._buffer[start : start + size + 2])
            if size == 0 and payload[0] == ACK:
                return b""
            if 0 < size == len(payload) - 2 and crc16(self._head + payload) == 0:
                return payload[:-2]
        return None


class RoboClawPackets(Packets[tuple[int, bytes]]):
    """The board's side: command and payload of each packet.

    `address`: 0x80 to 0x87; packets for others are passed over. `writes`: payload size of each
    writing command; every other command is a read without payload and CRC.
    """

    gap = 0.010

    def __init__(self, address: int, writes: Mapping[int, int]) -> None:
        super().__init__()
        self._address, self._writes = address, writes

    def _cut(self, buffer: bytearray, at: int) -> tuple[int, tuple[int, bytes] | None] | None:
        if buffer[at] != self._address:
            return 1, None
        if at + 1 >= len(buffer):
            return None
        size = self._writes.get(command := buffer[at + 1])
        if size is None:
            return 2, (command, b"")
        packet = bytes(buffer[at : at + size + 4])
        if len(packet) < size + 4:
            return None
        return (size + 4, (command, packet[2:-2])) if crc16(packet) == 0 else (1, None)
