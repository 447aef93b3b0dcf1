"""Whether the vehicle accepts our frames: nothing may be asked of it before it does.

A signed link refuses every frame that is older than the newest the vehicle has seen. Its clock runs
up to a minute ahead of ours, so the first frames of a new process are refused until we have heard
its clock. Were GUIDED asked for before one of our heartbeats was accepted, the failsafe that still
waits for one would choose HOLD at once.
"""

from __future__ import annotations

import math

EAGER, CALM = 0.1, 1.0
"""Between heartbeats, before and after one of them is known to be accepted [s]."""
SETTLE = 0.3
"""ArduPilot looks at its failsafes ten times a second: it has seen our heartbeat after this [s]."""
FORGET = 5.0
"""Without an answer for this long it is not known any more whether we are accepted [s]."""


class Greeting:
    """Concludes from answers: a vehicle that answers a question accepts it, and all sent later."""

    def __init__(self) -> None:
        self._answered = -math.inf
        self._accepted: float | None = None
        """When the first heartbeat went out that must have been accepted [s]."""
        self._first: float | None = None

    @property
    def answered(self) -> bool:
        """Whether the vehicle has ever answered."""
        return math.isfinite(self._answered)

    def on_answer(self, now: float) -> None:
        """Note an answer to a question of ours."""
        if self._first is None or now - self._answered > FORGET:
            self._first, self._accepted = now, None
        self._answered = now

    def on_heartbeat_sent(self, now: float) -> None:
        """Note a heartbeat of ours."""
        if self._first is not None and self._accepted is None and now > self._first:
            self._accepted = now

    def done(self, now: float) -> bool:
        """Whether a heartbeat of ours was accepted, and the failsafe has had time to see it."""
        fresh = now - self._answered <= FORGET
        return fresh and self._accepted is not None and now - self._accepted >= SETTLE

    def period(self, now: float) -> float:
        """Time between heartbeats [s]."""
        return CALM if self.done(now) else EAGER
