"""SLAMTEC RPLIDAR A1 and A2, standard scan (interface protocol LR001, rev. 2.x).

A request is 0xA5 and a command, with a payload its length, the payload and the XOR of all. An
answer begins with 0xA5 0x5A, 30 bits of length, 2 bits of mode and a type. A node has 5 bytes:
quality with the start bit and its inverse, a check bit with the angle [1/64 deg], the distance
[1/4 mm]; little-endian. Angles grow clockwise, seen from above.
"""

from __future__ import annotations

import math
import struct
import threading
import time
from dataclasses import dataclass
from functools import reduce
from operator import xor

from firmware_bridge.link import Transport
from firmware_bridge.sensors.lidar.lidar import SerialLidar, Turns

SYNC = 0xA5
STOP, RESET, SCAN, GET_INFO, GET_HEALTH, SET_PWM = 0x25, 0x40, 0x20, 0x50, 0x52, 0xF0
WITH_PAYLOAD = 0x80
DESCRIPTOR = b"\xa5\x5a"
INFO, HEALTH, NODES = 0x04, 0x06, 0x81
SIZES = {INFO: 20, HEALTH: 3, NODES: 5}  # bytes of an answer's data by its type
STREAM = 1  # mode of an answer that goes on until STOP
NODE = struct.Struct("<BHH")
CIRCLE = 360 * 64  # a turn in units of a node's angle
FORWARD, BACKWARD = 30 * 64, 4 * 64
"""From one node to the next the angle grows by less than the first, and falls by less than the
second: else a byte was lost."""
PROOF = 6
"""After a lost byte so many nodes in a row must be right before they count: chance makes one node
in fifty look right."""
BAUD = 115200
RANGE_MIN, RANGE_MAX = 0.15, 12.0  # [m]
RADIANS, METRES = math.tau / CIRCLE, 0.25e-3
PATIENCE = 0.4  # how long an answer may take [s]
QUIET = 0.02  # silence after STOP, of which the protocol wants 1 ms [s]
SPIN_UP = 3.0  # longest silence of a sensor that should scan, before it is restarted [s]
BOOT = 1.0  # how long RESET takes [s]
PWM = 660  # SLAMTEC's own default for the motor of an A2 on its USB adapter
SECOND_SERIES = 2
"""High digit of the model from which on the adapter takes a PWM; an A1's motor follows DTR."""
GOOD, WARNING, ERROR = 0, 1, 2  # status of GET_HEALTH


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

    angle: int  # clockwise [1/64 deg]
    distance: int  # [1/4 mm]; 0 for none
    quality: int  # 0 to 63
    start: bool  # whether it is the first of a turn

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
        self._proven: list[Node] = []  # nodes that wait for those that follow to prove them
        self._trusted = False
        self.bad = 0  # bytes skipped
        self.nodes = 0
        self.losses = 0  # how often bytes were found to be missing, or wrong

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


class Rplidar(SerialLidar):
    """Asks for identity and health, turns the motor, and takes nodes; restarts a stopped sensor.

    `transport`: not yet started.
    """

    name = "RPLIDAR"
    bauds = f"{BAUD}; 256000 of A2M7 and A2M12"

    def __init__(self, transport: Transport) -> None:
        super().__init__(transport, Turns(RANGE_MIN, RANGE_MAX))
        self._answers = RplidarAnswers()
        self._asked, self._answered = 0, threading.Event()
        self._model = 0
        self._status, self._code = GOOD, 0
        self._started = -math.inf
        self._links = self._starts = 0

    def _take(self, data: bytes, stamp: float) -> bool:
        answers, nodes = self._answers.feed(data)
        for kind, payload in answers:
            if kind == INFO:
                self._model = payload[0]
                series, kind_of = divmod(payload[0], 16)
                self.name = f"RPLIDAR A{series}M{kind_of}, firmware {payload[2]}.{payload[1]:02d}"
            elif kind == HEALTH:
                self._status, self._code = payload[0], int.from_bytes(payload[1:3], "little")
            if kind == self._asked:
                self._answered.set()
        angles = [node.angle * RADIANS for node in nodes]
        ranges = [n.distance * METRES if n.distance and n.quality else math.nan for n in nodes]
        self._turns.add(angles, ranges, stamp)
        return bool(answers or nodes)

    def _tend(self, now: float) -> None:
        """Start a sensor that does not scan: ask for identity and health, and let it scan."""
        links = self._transport.counters["reconnects"]
        if links != self._links:
            self._links, self._started = links, -math.inf
        if now - max(self._heard, self._started) <= SPIN_UP and self._started > -math.inf:
            return
        self._starts += 1
        self._transport.write(request(STOP))
        self._quit.wait(QUIET)
        with self._lock:
            self._answers.reset()
            self._turns.drop()
        if not (self._ask(GET_INFO, INFO) and self._ask(GET_HEALTH, HEALTH)):
            return
        if self._status == ERROR:
            self._transport.write(request(RESET))
            self._quit.wait(BOOT)
            return
        if self._model >> 4 >= SECOND_SERIES:
            self._transport.write(request(SET_PWM, PWM.to_bytes(2, "little")))
        self._transport.write(request(SCAN))
        self._started = time.monotonic()

    def _ask(self, command: int, kind: int) -> bool:
        """Ask a question; return whether the answer came in time."""
        self._asked = kind
        self._answered.clear()
        self._transport.write(request(command))
        return self._answered.wait(PATIENCE)

    def _farewell(self) -> None:
        self._transport.write(request(STOP))
        if self._model >> 4 >= SECOND_SERIES:
            self._transport.write(request(SET_PWM, bytes(2)))

    def _troubles(self, now: float) -> tuple[str, ...]:
        if self._status == ERROR:
            return (
                f"lidar: it reports an error (code {self._code}) and does not scan: is its motor "
                "blocked? Switch it off and on",
            )
        return ()

    def notes(self) -> tuple[str, ...]:
        """What stops no robot."""
        if self._status == WARNING:
            return (f"lidar: it reports a warning (code {self._code}): it may fail soon",)
        return ()

    def _counts(self) -> dict[str, int]:
        return {
            "nodes": self._answers.nodes,
            "bad_bytes": self._answers.bad,
            "losses": self._answers.losses,
            "starts": self._starts,
        }
