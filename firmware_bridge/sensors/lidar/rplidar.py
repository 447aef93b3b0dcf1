"""SLAMTEC RPLIDAR A1 and A2, standard scan."""

from __future__ import annotations

import math
import threading
import time

from firmware_bridge.link import Transport
from firmware_bridge.sensors.lidar.lidar import SerialLidar
from firmware_bridge.sensors.lidar.rplidar_frames import (
    CIRCLE,
    GET_HEALTH,
    GET_INFO,
    HEALTH,
    INFO,
    RESET,
    SCAN,
    SET_PWM,
    STOP,
    RplidarAnswers,
    request,
)
from firmware_bridge.sensors.lidar.turns import Turns

BAUD = 115200
RANGE_MIN, RANGE_MAX = 0.15, 12.0
"""[m]"""
RADIANS, METRES = math.tau / CIRCLE, 0.25e-3
PATIENCE = 0.4
"""How long an answer may take [s]."""
QUIET = 0.02
"""Silence after STOP, of which the protocol wants 1 ms [s]."""
SPIN_UP = 3.0
"""Longest silence of a sensor that should scan, before it is restarted [s]."""
BOOT = 1.0
"""How long RESET takes [s]."""
PWM = 660
"""SLAMTEC's own default for the motor of an A2 on its USB adapter."""
SECOND_SERIES = 2
"""High digit of the model from which on the adapter takes a PWM; an A1's motor follows DTR."""
GOOD, WARNING, ERROR = 0, 1, 2
"""Status of GET_HEALTH."""


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
