"""A RoboClaw robot on a clock turned by hand: the frames of `RoboClawDriver`, no thread.

The driver waits for replies in a thread of its own and on real time. Here each frame is handed to
the emulated board at once, so that an hour of driving takes minutes; a test holds the frames of
both against each other.
"""

from __future__ import annotations

import math
import random
import struct
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from firmware_bridge.drivers.roboclaw import (
    COUNTS,
    DUTY,
    RAW_SPEEDS,
    SET_TIMEOUT,
    SPEED,
    RoboClawOptions,
)
from firmware_bridge.link.framing import RoboClawReplies, roboclaw_packet, roboclaw_request
from firmware_bridge.messages import LinkError, LinkStatus, State
from kmpc_lab.emulator.mocap import Mocap
from kmpc_lab.emulator.roboclaw import RoboClawEmulator

POLL = 0.1
"""Between questions for the wheels' speeds [s]."""


class ManualClock:
    """Time that stands still until it is turned on."""

    def __init__(self, now: float = 1000.0) -> None:
        self.now = now

    def __call__(self) -> float:
        """Tell the time [s]."""
        return self.now


@dataclass(frozen=True)
class Network:
    """What lies between controller and board: commands arrive late.

    The delay is drawn anew every `period`.
    """

    shortest: float = 0.0
    """[s]"""
    longest: float = 0.0
    """[s]"""
    period: float = 1.0
    """[s]"""


class WiredRoboClaw:
    """A `Driver` for an emulated RoboClaw, with the pose from motion capture.

    Parameters
    ----------
    board : RoboClawEmulator
        On the same clock.
    options : RoboClawOptions
        As for `RoboClawDriver`.
    mocap : Mocap
        Gives the pose.
    clock : callable
        [s]
    network : Network
        Delays commands; what the board says comes at once.
    seed : int
        Of the delays.
    """

    def __init__(
        self,
        board: RoboClawEmulator,
        options: RoboClawOptions,
        mocap: Mocap,
        clock: Callable[[], float],
        network: Network,
        seed: int,
    ) -> None:
        self._board = board
        self._options = options
        self._mocap = mocap
        self._clock = clock
        self._network = network
        self._random = random.Random(seed)
        self._replies = RoboClawReplies()
        self._coming: deque[tuple[float, bytes]] = deque()
        self._drawn, self._delay = -math.inf, 0.0
        self._polled = -math.inf
        self._speeds = (0.0, 0.0)
        self._state: State | None = None
        self._released = False
        self.frames: list[bytes] | None = None
        """Where a test wants to see what goes out."""

    def connect(self, timeout: float) -> None:
        """Stop the board and set its watchdog."""
        self._ask(roboclaw_packet(self._options.address, SPEED, bytes(8)), SPEED, 0)
        watchdog = math.ceil(round(self._options.watchdog * 10.0, 6))
        self._ask(
            roboclaw_packet(self._options.address, SET_TIMEOUT, bytes((watchdog,))), SET_TIMEOUT, 0
        )
        self.work()

    def work(self) -> None:
        """Do what is due now: commands that arrive, poses, questions to the board."""
        now = self._clock()
        while self._coming and self._coming[0][0] <= now + 1e-9:
            self._ask(self._coming.popleft()[1], SPEED, 0)
        if now - self._polled >= POLL - 1e-9:
            self._polled = now
            address = self._options.address
            self._ask(roboclaw_request(address, COUNTS), COUNTS, 8)
            first, second = struct.unpack(
                ">ii", self._ask(roboclaw_request(address, RAW_SPEEDS), RAW_SPEEDS, 8)
            )
            turns = first / self._options.counts_per_turn, second / self._options.counts_per_turn
            v, omega, _ = self._board.geometry.body(self._board.geometry.from_channels(*turns))
            self._speeds = v, omega
        for stamp, (x, y, theta) in self._mocap.look(now, self._board.pose):
            self._state = State(x, y, theta, *self._speeds, stamp)

    def state(self) -> State | None:
        """Newest pose."""
        return self._state

    def health(self) -> LinkStatus:
        """A link that works, and the age of the pose."""
        stamp = -math.inf if self._state is None else self._state.stamp
        return LinkStatus(True, self._clock(), stamp, ready=not self._released)

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        """Command speeds: they arrive after the network's delay, in order."""
        left, right = self._board.geometry.wheels(v, omega)
        per_turn = self._options.counts_per_turn
        first, second = self._board.geometry.to_channels(left, right)
        frame = roboclaw_packet(
            self._options.address,
            SPEED,
            struct.pack(">ii", round(first * per_turn), round(second * per_turn)),
        )
        now, net = self._clock(), self._network
        if now - self._drawn >= net.period - 1e-9:
            self._drawn, self._delay = now, self._random.uniform(net.shortest, net.longest)
        if not net.longest:
            self._ask(frame, SPEED, 0)
            return
        due = now + self._delay
        while (
            self._coming and self._coming[-1][0] > due
        ):  # overtaken on the way: the newer one counts
            self._coming.pop()
        self._coming.append((due, frame))

    def stop(self) -> None:
        """Zero speed at once, then release."""
        self._coming.clear()
        self._released = True
        self._ask(roboclaw_packet(self._options.address, SPEED, bytes(8)), SPEED, 0)
        self._ask(roboclaw_packet(self._options.address, DUTY, bytes(4)), DUTY, 0)

    def close(self) -> None:
        """Stop."""
        self.stop()

    def _ask(self, frame: bytes, command: int, size: int) -> bytes:
        """Hand a frame to the board and decode its answer."""
        if self.frames is not None:
            self.frames.append(frame)
        self._replies.expect(self._options.address, command, size)
        reply = self._replies.feed(self._board.handle(frame))
        if reply is None:
            raise LinkError(f"the emulated board did not answer command {command}")
        return reply
