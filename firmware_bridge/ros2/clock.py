"""Stamps of messages: of the system's clock, or of a simulator's /clock."""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any

SILENT = 0.5
"""Age from which a simulator's clock counts as stopped [s]."""
RATES = (0.8, 1.25)
"""How much slower or faster than real time simulated time may run: the controller's period and the
gate's patience are of real time."""
SPAN = 2.0
"""Over which the rate is measured [s]."""
LEAST = 0.5
"""Shortest span that tells a rate [s]."""
MOST = 4000
"""Ticks of the simulator's clock that are kept."""


class RosClock:
    """Reads stamps in our monotonic time, and gives stamps to what we send.

    Parameters
    ----------
    simulated : bool
        Whether time comes from /clock (``use_sim_time``).
    system : callable
        The system's clock, of which stamps are otherwise [s].
    """

    def __init__(self, simulated: bool, system: Callable[[], float] = time.time) -> None:
        self.simulated, self._system = simulated, system
        self._told: deque[tuple[float, float]] = deque(maxlen=MOST)
        """Our time and the simulator's [s]."""

    def take(self, message: Any, now: float) -> None:
        """Take a Clock message that came at `now` [s]."""
        said = float(message.clock.sec) + 1e-9 * message.clock.nanosec
        if self._told and said < self._told[-1][1]:
            self._told.clear()  # a simulation that was begun anew
        self._told.append((now, said))
        while now - self._told[0][0] > SPAN:
            self._told.popleft()

    def local(self, stamp: float, now: float) -> float:
        """Stamp [s] as far as it is known in our time: of a simulator's clock only."""
        if not self.simulated or not self._told:
            return stamp
        heard, said = self._told[-1]
        return stamp - said + heard

    def stamp(self, now: float) -> tuple[int, int]:
        """Seconds and nanoseconds to put on what is sent at `now` [s]."""
        seconds = self._system()
        if self.simulated:
            heard, said = self._told[-1] if self._told else (now, 0.0)
            seconds = said + now - heard
        whole = math.floor(seconds)
        return whole, int((seconds - whole) * 1e9)

    def offset(self, way: float, now: float) -> float:
        """How far the system's clock is ahead of the sender's [s].

        Parameters
        ----------
        way : float
            Shortest arrival minus stamp seen, of our monotonic time [s].
        now : float
            Our monotonic time [s].
        """
        return way + self._system() - now

    def problem(self, now: float) -> str:
        """Why simulated time cannot be driven by, empty if it can."""
        if not self.simulated:
            return ""
        told = tuple(self._told)
        if not told or now - told[-1][0] > SILENT:
            return "no simulated time on /clock"
        if (span := told[-1][0] - told[0][0]) < LEAST:
            return ""
        rate = (told[-1][1] - told[0][1]) / span
        if RATES[0] <= rate <= RATES[1]:
            return ""
        return (
            f"simulated time runs at {rate:.2f} of real time: expected {RATES[0]:g} to {RATES[1]:g}"
        )
