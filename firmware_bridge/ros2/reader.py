"""Threads that take messages from subscriptions, no more than their ration."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence

from firmware_bridge.link.ration import Ration
from firmware_bridge.ros2.inputs import Source
from firmware_bridge.ros2.node import Subscription

PAUSE = 0.002
"""Between looks at subscriptions that have nothing [s]."""
SLOW_PAUSE = 0.02
"""The same of maps, which do not hurry [s]."""


class Reader:
    """Takes what has come, and hands it on; never raises.

    Parameters
    ----------
    sources : sequence
        Subscriptions with the receivers of their messages.
    pause : float
        Between looks if there was nothing [s].
    then : callable, optional
        Called with the time after each look: makes grids of maps.
    clock : callable
        Monotonic time [s].
    """

    def __init__(
        self,
        sources: Sequence[tuple[Subscription, Source]],
        pause: float = PAUSE,
        then: Callable[[float], None] = lambda now: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._sources, self._pause, self._then, self._clock = sources, pause, then, clock
        self._ration = Ration()
        self._quit = threading.Event()
        self._thread: threading.Thread | None = None
        self.errors = 0
        self.last_error = ""

    def start(self) -> None:
        """Begin to read, in a daemon thread."""
        self._thread = threading.Thread(target=self._run, name="ros2-reader", daemon=True)
        self._thread.start()

    def stop(self, timeout: float = 1.0) -> None:
        """Read no more; idempotent."""
        self._quit.set()
        if self._thread is not None:
            self._thread.join(timeout)

    def look(self) -> bool:
        """Take one message of each subscription; tell whether there was any."""
        found = False
        for subscription, source in self._sources:
            taken = subscription.take()
            if taken is None:
                continue
            found = True
            if taken[0] is not None:
                self._guarded(lambda: source.take(taken[0], self._clock()))  # noqa: B023
        self._guarded(lambda: self._then(self._clock()))
        return found

    def _guarded(self, action: Callable[[], None]) -> None:
        try:
            action()
        except Exception as error:  # whatever is on the network, the robot goes on
            self.errors += 1
            self.last_error = f"{type(error).__name__}: {error}"

    def _run(self) -> None:
        while not self._quit.is_set():
            self._ration.begin()
            found = self.look()
            self._ration.end(0)
            rest = self._ration.rest() if found else self._pause
            if rest > 0.0:
                self._quit.wait(rest)
