"""Bytes <-> requests, answers and nodes of SLAMTEC's RPLIDAR (interface protocol LR001, rev. 2.x).

A request is 0xA5 and a command, with a payload its length, the payload and the XOR of all. An
answer begins with 0xA5 0x5A, 30 bits of length, 2 bits of mode and a type. A node has 5 bytes:
quality with the start bit and its inverse, a check bit with the angle [1/64 deg], the distance
[1/4 mm]; little-endian. Angles grow clockwise, seen from above.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import reduce
from operator import xor

SYNC = 0xA5
STOP, RESET, SCAN, GET_INFO, GET_HEALTH, SET_PWM = 0x25, 0x40, 0x20, 0x50, 0x52, 0xF0
WITH_PAYLOAD = 0x80
DESCRIPTOR = b"\xa5\x5a"
INFO, HEALTH, NODES = 0x04, 0x06, 0x81
SIZES = {INFO: 20, HEALTH: 3, NODES: 5}
"""Bytes of an answer's data by its type."""
STREAM = 1
"""Mode of an answer that goes on until STOP."""
NODE = struct.Struct("<BHH")
CIRCLE = 360 * 64
"""A turn in units of a node's angle."""
FORWARD, BACKWARD = 30 * 64, 4 * 64
"""From one node to the next the angle grows by less than the first, and falls by less than the
second: else a byte was lost."""
PROOF = 6
"""After a lost byte so many nodes in a row must be right before they count: chance makes one node
in fifty look right."""


def request(command: int, payload: bytes = b"") -> bytes:
    """Build a request.

    >>> request(SCAN).hex(" "), request(SET_PWM, (660).to_bytes(2, "little")).hex(" ")
    ('a5 20', 'a5 f0 02 94 02 c1')
    """
    if not command & WITH_PAYLOAD:
        return bytes((SYNC, command))
    body = bytes((SYNC, command, len(payload))) + payload
    return body + bytes((reduce(xor, body),))


def descriptor(kind: int) -> bytes:
    """Build what an answer begins with.

    >>> descriptor(NODES).hex(" "), descriptor(HEALTH).hex(" ")
    ('a5 5a 05 00 00 40 81', 'a5 5a 03 00 00 00 06')
    """
    mode = STREAM if kind == NODES else 0
    return DESCRIPTOR + (SIZES[kind] | mode << 30).to_bytes(4, "little") + bytes((kind,))


@dataclass(frozen=True)
class Node:
    """One beam."""

    angle: int
    """Clockwise [1/64 deg]."""
    distance: int
    """[1/4 mm]; 0 for none."""
    quality: int
    """0 to 63."""
    start: bool
    """Whether it is the first of a turn."""

    def to_bytes(self) -> bytes:
        """Build the node.

        >>> Node(angle=64 * 90, distance=4000, quality=15, start=True).to_bytes().hex(" ")
        '3d 01 2d a0 0f'
        """
        return NODE.pack(
            self.quality << 2 | (1 if self.start else 2), self.angle << 1 | 1, self.distance
        )


class RplidarAnswers:
    """Answers and nodes out of bytes."""

    def __init__(self) -> None:
        self._buffer = bytearray()
        self._streaming = False
        self._previous: int | None = None
        self._proven: list[Node] = []
        """Nodes that wait for those that follow to prove them."""
        self._trusted = False
        self.bad = 0
        """Bytes skipped."""
        self.nodes = 0
        self.losses = 0
        """How often bytes were found to be missing, or wrong."""

    def reset(self) -> None:
        """Expect an answer, no nodes any more."""
        self._buffer.clear()
        self._streaming = False
        self._lose()

    def feed(self, data: bytes) -> tuple[list[tuple[int, bytes]], list[Node]]:
        """Take bytes; gives the answers (type, data) and the nodes that are now whole."""
        self._buffer += data
        answers: list[tuple[int, bytes]] = []
        while not self._streaming:
            answer = self._answer()
            if answer is None:
                return answers, []
            if answer[0] != NODES:
                answers.append(answer)
        return answers, self._nodes()

    def _answer(self) -> tuple[int, bytes] | None:
        """Next answer; None if there is none yet. That nodes follow is one without data."""
        buffer = self._buffer
        while True:
            start = buffer.find(DESCRIPTOR)
            if start < 0:
                start = len(buffer) - buffer.endswith(DESCRIPTOR[:1])
            self.bad += start
            del buffer[:start]
            if len(buffer) < 7:
                return None
            kind = buffer[6]
            if kind not in SIZES or bytes(buffer[:7]) != descriptor(kind):
                self.bad += 1
                del buffer[:1]
                continue
            if kind == NODES:
                del buffer[:7]
                self._streaming = True
                return NODES, b""
            end = 7 + SIZES[kind]
            if len(buffer) < end:
                return None
            payload = bytes(buffer[7:end])
            del buffer[:end]
            return kind, payload

    def _nodes(self) -> list[Node]:
        """Nodes that are whole and follow from those before."""
        buffer, found, at = self._buffer, [], 0
        end = len(buffer) - NODE.size
        while at <= end:
            head, angle, distance = NODE.unpack_from(buffer, at)
            if not self._right(head, angle):
                self.losses += self._trusted
                self._lose()
                self.bad += 1
                at += 1
                continue
            self._previous = angle >> 1
            node = Node(angle >> 1, distance, head >> 2, bool(head & 1))
            at += NODE.size
            self._proven.append(node)
            self._trusted = self._trusted or len(self._proven) >= PROOF
            if self._trusted:
                # the last waits for its successor: a byte lost in its distance shows only there
                found += self._proven[:-1]
                self._proven = [node]
        del buffer[:at]
        self.nodes += len(found)
        return found

    def _right(self, head: int, angle: int) -> bool:
        """Whether the bits of a node are as they must be, and its angle follows from the last."""
        if (head ^ head >> 1) & 1 == 0 or not angle & 1 or angle >> 1 >= CIRCLE:
            return False
        if self._previous is None:
            return True
        grown = ((angle >> 1) - self._previous + BACKWARD) % CIRCLE
        return grown < FORWARD + BACKWARD

    def _lose(self) -> None:
        """Trust no node until enough in a row are right."""
        self.bad += NODE.size * len(self._proven)
        self._trusted, self._previous, self._proven = False, None, []
