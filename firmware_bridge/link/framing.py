"""Bytes <-> frames of the serial motor controllers.

Pure functions, and decoders that hold a bounded buffer.

RoboClaw and VESC frames carry CRC-16/XMODEM (poly 0x1021, start 0); ODrive lines carry an optional
XOR.
"""

from __future__ import annotations

from binascii import crc_hqx
from collections.abc import Mapping

ROBOCLAW_ACK = 0xFF
ROBOCLAW_GAP = 0.010
"""A longer gap within a packet makes the board discard it [s]."""
ROBOCLAW_BYTES = 128
"""An answer that lies deeper in noise than this is not looked for."""
VESC_SHORT, VESC_LONG, VESC_STOP = 0x02, 0x03, 0x03
VESC_GAP = 0.1
"""Half a frame that is older is given up [s]."""
LINE_BYTES = 256


def crc16(data: bytes, start: int = 0) -> int:
    """CRC-16/XMODEM.

    Examples
    --------
    >>> hex(crc16(b"123456789"))
    '0x31c3'
    """
    return crc_hqx(data, start)


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


def odrive_line(text: str, checksum: bool) -> bytes:
    r"""Build a line, with its XOR if asked.

    Examples
    --------
    >>> odrive_line("r vbus_voltage ", True)
    b'r vbus_voltage *93\n'
    """
    body = text.encode("ascii")
    return body + (b"*%d" % xor8(body) if checksum else b"") + b"\n"


def xor8(data: bytes) -> int:
    """XOR of all bytes."""
    total = 0
    for byte in data:
        total ^= byte
    return total


def odrive_text(line: bytes, checksum: bool) -> str | None:
    """Text of a line, None for a damaged one.

    Parameters
    ----------
    line : bytes
        Without its end.
    checksum : bool
        Whether it must carry one; one that is there is always checked.
    """
    body, star, digits = line.partition(b"*")
    if star:
        if not digits.strip().isdigit() or int(digits) != xor8(body):
            return None
    elif checksum:
        return None
    text = body.strip()
    return (
        text.decode("ascii")
        if text and text.isascii() and all(32 <= byte < 127 for byte in text)
        else None
    )


class Lines:
    """Cuts bytes into lines that end in CR, LF or both.

    A line of more than 256 bytes is dropped up to its end.
    """

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._dropping = False
        self.bad = 0
        """Bytes dropped."""

    def reset(self) -> None:
        """Forget half a line."""
        self.bad += len(self._buffer)
        self._buffer.clear()

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; returns whole lines without their ends."""
        *whole, rest = (bytes(self._buffer) + data).replace(b"\r", b"\n").split(b"\n")
        if self._dropping and whole:
            self.bad += len(whole.pop(0))
            self._dropping = False
        found = [line for line in whole if line and len(line) <= LINE_BYTES]
        self.bad += sum(len(line) for line in whole if len(line) > LINE_BYTES)
        if len(rest) > LINE_BYTES or self._dropping:
            self.bad += len(rest)
            self._dropping, rest = True, b""
        self._buffer = bytearray(rest)
        return found
