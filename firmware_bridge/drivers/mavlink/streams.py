"""Requests telemetry, measures its rates, and repeats requests if a station lowers a rate.

A ground station that asks for its own stream rates (MAVProxy does so every 15 s) lowers ours, where
both talk over one port.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass, field

from firmware_bridge.drivers.mavlink.commands import ACCEPTED, SET_MESSAGE_INTERVAL, CommandDesk

EKF_STATUS = 193
EKF_RATE, HEARTBEAT_RATE, ORIGIN_RATE = 20.0, 5.0, 1.0  # largest rates that are asked for [Hz]
LATE_PERIODS, LATE = 3.0, 0.03
"""A stream is late after this many of its periods, plus this time on the link [s]."""
ENOUGH = 0.75  # less than this share of the rate that was asked for is too little
WINDOW, PERIODS = 1.0, 8
"""Rates are counted over this time [s], and over at least this many of a stream's periods: one that
comes once a second, and now and then a little later, would count as none at all."""
AGAIN, RAREST = 0.3, 5.0
"""First and longest time after which a stream that is too slow is asked for again [s]; it doubles
each time that asking does not help."""
OFTEN, MINUTE = 3, 60.0
"""A stream that pauses this many times in this time [s] is lowered repeatedly; one pause may be
a stall of anything."""
TOLD = 10.0  # how long a lowered stream is reported [s]
CAUSE = "another station lowers it (MAVProxy: --streamrate -1), or the link is too slow"
ALIVE = 3.0  # a stream seen within this time counts as coming, though perhaps too slowly [s]


@dataclass
class Stream:
    """One kind of telemetry."""

    message: int  # its message id
    name: str
    rates: tuple[float, ...]  # rates to ask for, the next where one is refused [Hz]
    needed: bool = True
    level: int = 0
    seen: float = -float("inf")
    asked: float = -float("inf")
    answered: bool = False
    refused: bool = False  # whether the vehicle gives it at no rate
    lowered: float = -float("inf")  # when it was last found to come too slowly [s]
    _again: float = AGAIN
    _since: float = float("inf")
    _times: deque[float] = field(default_factory=lambda: deque(maxlen=512))
    _pauses: deque[tuple[float, float]] = field(default_factory=lambda: deque(maxlen=64))

    @property
    def rate(self) -> float:
        """Rate that is asked for [Hz]."""
        return self.rates[self.level]

    @property
    def window(self) -> float:
        """Time over which it is counted [s]."""
        return max(WINDOW, PERIODS / self.rate)

    def saw(self, now: float) -> None:
        """Note that one came."""
        if self.answered and self._late_after < now - self.seen < float("inf"):
            self._pauses.append((now, now - self.seen))
        self.seen = now
        self._times.append(now)
        if self._since == float("inf"):
            self._since = now

    @property
    def _late_after(self) -> float:
        return LATE_PERIODS / self.rate + LATE

    def measured(self, now: float) -> float:
        """How often it comes [Hz]."""
        while self._times and self._times[0] < now - self.window:
            self._times.popleft()
        return len(self._times) / self.window

    def too_slow(self, now: float) -> bool:
        """Whether it comes, or came until now, less often than was asked for."""
        if self.refused or not self.answered or now - self.seen > ALIVE:
            return False
        late = now - self.seen > self._late_after
        counted = now - max(self._since, self.asked) > 1.5 * self.window
        return late or (counted and self.measured(now) < ENOUGH * self.rate)

    def cause(self, now: float) -> str:
        """Why it was found to come too slowly, in words."""
        rare = self.measured(now) < ENOUGH * self.rate
        pauses = [pause for when, pause in self._pauses if now - when < MINUTE]
        asked = f"{self.rate:.0f} Hz was asked for: {CAUSE}"
        if rare or not pauses:
            return f"{self.name} comes at {self.measured(now):.0f} Hz, {asked}"
        if len(pauses) >= OFTEN:
            return f"{self.name} paused {len(pauses)} times within a minute, {asked}"
        return (
            f"{self.name} paused for {max(pauses):.2f} s, and comes at {self.measured(now):.0f} Hz "
            "again: the link or the vehicle stalled"
        )

    def ask_again(self, now: float) -> bool:
        """Whether to ask again now; each time that it does not help it is asked more rarely."""
        if not self.too_slow(now):
            if now - self.asked > 2.0 * WINDOW:
                self._again = AGAIN
            return False
        if now - self.asked < self._again:
            return False
        self._again = min(2.0 * self._again, RAREST)
        self.lowered = now
        return True


@dataclass
class StreamRequests:
    """Asks for one stream after the other, at a lower rate where a higher one is denied."""

    desk: CommandDesk
    streams: tuple[Stream, ...]
    patience: float = 1.5
    """How long a stream may be silent, after it was asked for or last seen [s]."""
    lowered: int = 0  # how often a stream was found to come more rarely than asked for
    _current: Stream | None = field(default=None, init=False)

    def saw(self, message: int, now: float) -> None:
        """Note that a message of this id came."""
        for stream in self.streams:
            if stream.message == message:
                stream.saw(now)

    def rate(self, message: int) -> float:
        """Rate that is asked for of a message id [Hz]."""
        return next(stream.rate for stream in self.streams if stream.message == message)

    @property
    def answered(self) -> bool:
        """Whether the vehicle has answered every request at least once."""
        return all(stream.answered for stream in self.streams)

    def refused(self) -> tuple[str, ...]:
        """Names of what is needed and not given."""
        return tuple(stream.name for stream in self.streams if stream.needed and stream.refused)

    def notes(self, now: float) -> tuple[str, ...]:
        """Which streams are lowered, in words a user can act on."""
        return tuple(
            stream.cause(now)
            for stream in self.streams
            if stream.needed and now - stream.lowered < TOLD
        )

    def warning(self, now: float) -> str:
        """Say that streams are lowered, in words that stay the same; empty where they are not."""
        lowered = any(CAUSE in note for note in self.notes(now))
        return f"telemetry comes too rarely: {CAUSE}" if lowered else ""

    def tick(self, now: float) -> None:
        """Take the answer to the last request; ask the next that is silent or too slow."""
        self._restore(now)
        if self._current is not None:
            result = self.desk.result(SET_MESSAGE_INTERVAL)
            if result is None:
                return
            self._settle(self._current, result)
            self.desk.cancel(SET_MESSAGE_INTERVAL)
            self._current = None
        due = [
            stream
            for stream in self.streams
            if not stream.answered or now - max(stream.seen, stream.asked) > self.patience
        ]
        if due:
            stream = self._current = min(due, key=lambda s: s.asked)
            stream.asked = now
            self.desk.request(
                SET_MESSAGE_INTERVAL, stream.message, round(1e6 / stream.rate), now=now
            )

    def _restore(self, now: float) -> None:
        """Request all again at once if one comes too slowly: a station that lowers one lowers all.

        Nobody waits for the answers, which were given before; whether it helps is counted.
        """
        slow = [stream for stream in self.streams if stream.ask_again(now)]
        self.lowered += len(slow)
        for stream in self.streams if slow else ():
            if stream.answered and not stream.refused:
                stream.asked = now
                self.desk.say(SET_MESSAGE_INTERVAL, stream.message, round(1e6 / stream.rate))

    def _settle(self, stream: Stream, result: int) -> None:
        if result == ACCEPTED:
            stream.answered, stream.refused = True, False
        elif stream.level + 1 < len(stream.rates):
            stream.level += 1
        else:
            stream.answered = stream.refused = True


def wanted_streams(rate: float) -> tuple[Stream, ...]:
    """Telemetry that a drive needs, poses `rate` times a second [Hz]."""
    rates = rates_from(rate)
    return (
        Stream(32, "LOCAL_POSITION_NED", rates),
        Stream(30, "ATTITUDE", rates),
        Stream(EKF_STATUS, "EKF_STATUS_REPORT", rates_from(min(rate, EKF_RATE))),
        Stream(0, "HEARTBEAT", (HEARTBEAT_RATE,), needed=False),
        Stream(49, "GPS_GLOBAL_ORIGIN", (ORIGIN_RATE,), needed=False),
    )


def rates_from(rate: float) -> tuple[float, ...]:
    """Rates to try, from `rate` down [Hz]: ArduPilot gives at most 0.8 of its loop rate.

    Examples
    --------
    >>> rates_from(50.0)
    (50.0, 40.0, 25.0, 20.0, 10.0, 5.0)
    """
    return (rate, *(lower for lower in (40.0, 25.0, 20.0, 10.0, 5.0) if lower < rate))
