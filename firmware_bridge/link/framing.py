"""Bytes <-> frames of serial boards: pure functions, and bounded decoders."""

from __future__ import annotations

import math
from binascii import crc_hqx
from collections.abc import Mapping
from typing import Generic, TypeVar

T = TypeVar("T")
LINE_BYTES = 256
RUN = 254  # bytes without a zero that one code byte covers
SHORT, LONG, STOP = 0x02, 0x03, 0x03
ACK = 0xFF
DEEPEST = 128  # an answer that lies deeper in noise than this is not looked for [bytes]


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

    gap = math.inf  # half a packet that is older is given up [s]

    def __init__(self) -> None:
        self._buffer, self._stamp = bytearray(), -math.inf
        self.bad = 0  # bytes passed over

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

    `line`: without its end. `checksum`: whether it must carry one; one that is there is always
    checked.
    """
    body, star, digits = line.partition(b"*")
    if star:
        if not digits.strip().isdigit() or int(digits) != xor8(body):
            return None
    elif checksum:
        return None
    text = body.strip()
    printable = text.isascii() and text.decode("latin-1").isprintable()
    return text.decode("ascii") if text and printable else None


class Lines:
    """Cuts bytes into lines that end in CR, LF or both.

    A line of more than 256 bytes is dropped up to its end. A checksum that fits ends a line, too:
    an ODrive's firmware before 0.5.3 sends no end behind one.
    """

    def __init__(self) -> None:
        self._buffer, self._dropping = bytearray(), False
        self.bad = 0  # bytes dropped

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
        if b"*" in rest and odrive_text(rest, True) is not None:
            found, rest = [*found, rest], b""
        self._buffer = bytearray(rest)
        return found


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
        self.bad = 0  # frames that were damaged, or too long

    def feed(self, data: bytes) -> list[bytes]:
        """Take bytes; returns the bodies of the frames that end in them."""
        *frames, rest = (self._rest + data).split(b"\0")
        self._rest = rest[: self._longest + 1]  # one that is too long stays too long
        bodies = [cobs_body(f) if len(f) <= self._longest else None for f in frames if f]
        found = [body for body in bodies if body is not None]
        self.bad += len(bodies) - len(found)
        return found


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
        self.bad = 0  # bytes skipped as part of no answer

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
