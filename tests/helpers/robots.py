"""Helpers of the bridge's tests.

A clock that is turned by hand, a robot behind a driver that can fail.
"""

import math

from firmware_bridge.messages import LinkStatus, State, VelocityCommand
from firmware_bridge.runtime.controller_thread import unicycle_arc


class Clock:
    """Time as a test wants it."""

    def __init__(self, now: float = 1000.0) -> None:
        self.now = now
        self.slept: list[float] = []

    def __call__(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.slept.append(seconds)
        self.now += seconds


class FakeDriver:
    """A robot that does exactly what it is told, `latency` late, and tells its pose `delay`
    late.
    """

    def __init__(self, clock: Clock, delay: float = 0.0, latency: float = 0.0) -> None:
        self.clock, self.delay, self.latency = clock, delay, latency
        self.coming: list[tuple[float, float, float]] = []
        self.path = [State(0.0, 0.0, 0.0, 0.0, 0.0, clock())]
        self.sent: list[tuple[float, float, float]] = []
        self.stops: list[float] = []
        self.ready, self.pose_ok, self.connected, self.silent = True, True, True, False
        self.faults: tuple[str, ...] = ()
        self.fails: set[str] = set()
        self.silent_since = -math.inf
        self.taken = 0
        self.frame_doubt = ""

    def move(self) -> State:
        """Go on to the present and give the true state."""
        while self.coming and self.coming[0][0] + self.latency <= self.clock():
            at, v, omega = self.coming.pop(0)
            here = self._roll(at + self.latency)
            self.path[-1] = State(here.x, here.y, here.theta, v, omega, here.stamp)
        return self._roll(self.clock())

    def _roll(self, until: float) -> State:
        last = self.path[-1]
        if until > last.stamp:
            self.path.append(unicycle_arc(last, last.v, last.omega, until - last.stamp))
        return self.path[-1]

    def _fail(self, name: str) -> None:
        if name in self.fails:
            raise RuntimeError(f"{name} fails")

    def connect(self, timeout: float) -> None:
        self._fail("connect")

    def state(self) -> State | None:
        self._fail("state")
        self.move()
        until = (self.silent_since if self.silent else self.clock()) - self.delay
        return next((s for s in reversed(self.path) if s.stamp <= until + 1e-9), None)

    def health(self) -> LinkStatus:
        self._fail("health")
        stamp = self.silent_since if self.silent else self.clock()
        return LinkStatus(
            self.connected,
            stamp,
            stamp - self.delay,
            self.ready,
            self.pose_ok,
            faults=self.faults,
            frame_doubt=self.frame_doubt,
        )

    def send(self, v: float, omega: float, vy: float = 0.0) -> None:
        self._fail("send")
        assert math.isfinite(v) and math.isfinite(omega)
        self.coming.append((self.clock(), v, omega))
        self.move()
        self.sent.append((self.clock(), v, omega))

    def stop(self) -> None:
        self._fail("stop")
        self.coming.append((self.clock(), 0.0, 0.0))
        self.move()
        self.stops.append(self.clock())
        self.ready = self.ready and self.silent  # as an autopilot does that goes to HOLD

    def confirm(self) -> None:
        self.frame_doubt = ""

    def take(self) -> None:
        self.taken += 1
        self.ready = True

    def close(self) -> None:
        self._fail("close")

    def go_silent(self) -> None:
        self.silent, self.silent_since = True, self.clock()


def constant(clock: Clock, v: float = 0.3, omega: float = 0.2):
    """A controller that always wants the same."""
    return lambda state: VelocityCommand(v, omega, clock())
