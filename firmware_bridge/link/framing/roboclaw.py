"""Packets of RoboClaw boards, in packet serial mode."""

from __future__ import annotations

from collections.abc import Mapping

from firmware_bridge.link.framing.crc import crc16

ROBOCLAW_ACK = 0xFF
ROBOCLAW_GAP = 0.010
"""A longer gap within a packet makes the board discard it [s]."""
ROBOCLAW_BYTES = 128
"""An answer that lies deeper in noise than this is not looked for."""


def roboclaw_packet(address: int, command: int, payload: bytes = b"") -> bytes:
    """Build a packet that writes: address, command, payload, CRC; the board answers 0xFF.

    Examples
    --------
    >>> roboclaw_packet(0x80, 14, bytes([3])).hex(" ")
    '80 0e 03 28 36'
    """
    body = bytes((address, command)) + payload
    return body + crc16(body).to_bytes(2, "big")


def roboclaw_request(address: int, command: int) -> bytes:
    """Build a packet that reads: it carries no CRC."""
    return bytes((address, command))


def roboclaw_reply(address: int, command: int, payload: bytes) -> bytes:
    """Build the board's answer to a read: the CRC covers address and command too."""
    return payload + crc16(bytes((address, command)) + payload).to_bytes(2, "big")


class RoboClawReplies:
    """Finds the answer to the request under way: answers carry no header of their own."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._head = b""
        self._sizes: tuple[int, ...] = ()
        self.bad = 0
        """Bytes skipped as part of no answer."""

    def expect(self, address: int, command: int, *sizes: int) -> None:
        """Wait for this command's answer, of one of these payload sizes; 0 is the bare 0xFF."""
        self.bad += len(self._buffer)
        self._buffer.clear()
        self._head, self._sizes = bytes((address, command)), sizes

    def feed(self, data: bytes) -> bytes | None:
        """Take bytes; returns the payload of the answer once, then nothing until `expect`."""
        self._buffer += data
        self._skip(len(self._buffer) - ROBOCLAW_BYTES)
        if self._sizes:
            for start in range(len(self._buffer)):
                payload = self._match(start)
                if payload is not None:
                    self.bad += start
                    del self._buffer[: start + (len(payload) + 2 if payload else 1)]
                    self._sizes = ()
                    return payload
        keep = max(self._sizes, default=-2) + 1
        self._skip(len(self._buffer) - max(0, keep))
        return None

    def _skip(self, count: int) -> None:
        if count > 0:
            self.bad += count
            del self._buffer[:count]

    def _match(self, start: int) -> bytes | None:
        for size in self._sizes:
            if size == 0:
                if self._buffer[start] == ROBOCLAW_ACK:
                    return b""
            elif start + size + 2 <= len(self._buffer):
                payload = bytes(self._buffer[start : start + size])
                if crc16(self._head + payload) == int.from_bytes(
                    self._buffer[start + size : start + size + 2], "big"
                ):
                    return payload
        return None


class RoboClawPackets:
    """The board's side: packets out of bytes.

    Parameters
    ----------
    address : int
        0x80 to 0x87; packets for others are passed over.
    writes : mapping
        Payload size of each writing command; every other command is a read without payload and CRC.
    """

    def __init__(self, address: int, writes: Mapping[int, int]) -> None:
        self._address, self._writes = address, writes
        self._buffer = bytearray()
        self._stamp = -float("inf")
        self.bad = 0
        """Bytes skipped, damaged packets included."""

    def feed(self, data: bytes, stamp: float) -> list[tuple[int, bytes]]:
        """Take bytes that came at `stamp` [s]; returns (command, payload) of each whole packet."""
        if self._buffer and stamp - self._stamp > ROBOCLAW_GAP:
            self.bad += len(self._buffer)
            self._buffer.clear()
        self._stamp = stamp
        self._buffer += data
        found: list[tuple[int, bytes]] = []
        at, end = 0, len(self._buffer)
        while at < end:
            if self._buffer[at] != self._address:
                at += 1
                self.bad += 1
                continue
            if at + 1 >= end:
                break
            command = self._buffer[at + 1]
            size = self._writes.get(command)
            if size is None:
                found.append((command, b""))
                at += 2
                continue
            if at + size + 4 > end:
                break
            body = bytes(self._buffer[at : at + 2 + size])
            if crc16(body) == int.from_bytes(self._buffer[at + 2 + size : at + 4 + size], "big"):
                found.append((command, body[2:]))
                at += size + 4
            else:
                at += 1
                self.bad += 1
        del self._buffer[:at]
        return found
