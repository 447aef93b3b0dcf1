"""Questions and answers on a serial line, one at a time, and the newest command to the board."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Hashable
from dataclasses import dataclass

from firmware_bridge.link import Transport

STRANGERS, STRANGERS_WITHIN = 5, 1.0
"""This many unsolicited replies within this many seconds: another program talks to the
board. A reply that comes after its time-out is none of them, if it comes within this time."""
MOST_LATE = 100
"""Questions given up whose replies may still come: more than there are in that time."""


class NoReply(Exception):
    """A reply that did not come in time, or made no sense."""


class Exchange:
    """Asks in one thread, takes replies from another.

    `transport`: the line. `reply_timeout`: how long a reply may take [s]. `begin`: prepares the
    decoder for the reply to a key.
    """

    def __init__(
        self, transport: Transport, reply_timeout: float, begin: Callable[[Hashable], None]
    ) -> None:
        self._transport, self._reply_timeout, self._begin = transport, reply_timeout, begin
        self.changed = threading.Condition()
        """Held while reading or writing shared data; notified of replies."""
        self.closing = False
        self.expected: Hashable = None
        """Key of the reply that is waited for."""
        self.heard = -math.inf
        """When the board last answered [s]."""
        self._reply: tuple[bytes, float] | None = None
        self._strangers: list[float] = []
        self._given_up: deque[float] = deque(maxlen=MOST_LATE)
        self.counters = dict.fromkeys(
            ("frames", "timeouts", "unexpected_replies", "refused_replies"), 0
        )

    def ask(self, frame: bytes, key: Hashable) -> tuple[bytes, float]:
        """Send a question and wait; returns its reply and the best estimate of its moment [s]."""
        with self.changed:
            self._begin(key)
            self.expected, self._reply = key, None
            sent = time.monotonic()
            if not self._transport.write(frame):
                self.expected = None
                raise NoReply
            self.changed.wait_for(
                lambda: self._reply is not None or self.closing, self._reply_timeout
            )
            self.expected = None
            if self._reply is None:
                self.counters["timeouts"] += not self.closing
                self._given_up.append(sent)
                raise NoReply
            reply, received = self._reply
            self.heard = received
            self.counters["frames"] += 1
        return reply, (sent + received) / 2.0

    def deliver(self, key: Hashable, reply: bytes, stamp: float) -> None:
        """Hand a reply to the question that waits for it; any other is refused and counted."""
        with self.changed:
            if key is not None and key == self.expected and self._reply is None:
                self._reply = (reply, stamp)
                self.changed.notify_all()
                return
            self.counters["unexpected_replies"] += 1
            if not self._is_late(stamp):
                self._strangers = [*self._strangers[1 - STRANGERS :], stamp]

    def _is_late(self, stamp: float) -> bool:
        """Whether a reply may be to a question of ours that was given up: each has one."""
        while self._given_up:
            if stamp - self._given_up.popleft() < STRANGERS_WITHIN:
                return True
        return False

    def refuse(self, why: str) -> NoReply:
        """Count a reply that came for the right question and makes no sense."""
        self.counters["refused_replies"] += 1
        return NoReply(why)

    def strangers(self, now: float) -> bool:
        """Whether another program must be asking: many replies are unsolicited."""
        return len(self._strangers) == STRANGERS and now - self._strangers[0] < STRANGERS_WITHIN

    def wait(self, done: Callable[[], bool], seconds: float) -> None:
        """Wait until `done`, or the end of the driver."""
        if seconds > 0.0:
            with self.changed:
                self.changed.wait_for(lambda: self.closing or done(), seconds)


@dataclass
class HeldCommand:
    """Speeds of all channels; the driver's lock is held around every call."""

    timeout: float
    """A command that is older is replaced by zero [s]."""
    repeats: int
    """How often a zero is repeated."""
    value: tuple[float, ...]
    """[motor turns/s]"""
    stamp: float = -math.inf
    """When it came, on the monotonic clock [s]."""
    pending: bool = False
    """Whether it is still to be sent."""
    zeros: int = 0
    """How many repetitions of a zero are left."""

    def put(self, value: tuple[float, ...], now: float) -> None:
        """Take a new command [motor turns/s]."""
        self.value, self.stamp = value, now
        self.pending, self.zeros = True, self.repeats

    def repeat_zero(self) -> None:
        """Send a zero once more, where it may have been lost."""
        if self.zeros and not any(self.value):
            self.zeros -= 1
            self.pending = True

    def withdraw_old(self, now: float) -> bool:
        """Replace a command that has become old by zero; True if that was needed."""
        if not any(self.value) or now - self.stamp <= self.timeout:
            return False
        self.value, self.pending, self.zeros = (0.0,) * len(self.value), True, self.repeats
        return True

    def stands(self, now: float) -> bool:
        """Whether a standstill is requested now, or nothing yet."""
        never = self.stamp == -math.inf
        return not any(self.value) and (never or now - self.stamp < self.timeout)
