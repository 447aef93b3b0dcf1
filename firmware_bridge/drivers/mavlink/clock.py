"""Converts the vehicle's time to ours: TIMESYNC, and `time_boot_ms` that wraps after 49.7 days."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

WRAP = 2.0**32 / 1000.0  # period of `time_boot_ms` [s]
WINDOW = 20  # number of recent round trips of which the shortest is used
SETTLED = 10
PENDING = 8  # requests that may still be answered
LONGEST = 0.5  # longest round trip that is used [s]
REBOOT = 1.0  # the autopilot was restarted if `time_boot_ms` runs back by more than this [s]


@dataclass(frozen=True)
class RoundTrip:
    """One answered TIMESYNC request."""

    offset: float  # vehicle's clock minus ours, give or take half the duration [s]
    duration: float  # [s]


class VehicleClock:
    """Offset of the vehicle's clock from `time.monotonic()`, by the shortest recent round trips."""

    def __init__(self) -> None:
        self._asked: deque[int] = deque(maxlen=PENDING)
        self._trips: deque[RoundTrip] = deque(maxlen=WINDOW)
        self._last_boot: float | None = None
        self.resets = 0
        """How often the vehicle's clock began anew, since the autopilot was restarted."""
        self.jumps = 0  # how often the vehicle's clock was set or began anew

    @property
    def best(self) -> RoundTrip | None:
        """Shortest round trip, None before the first."""
        return min(self._trips, key=lambda trip: trip.duration, default=None)

    @property
    def settled(self) -> bool:
        """Whether enough round trips are known to choose from."""
        return len(self._trips) >= SETTLED

    def ask(self, now: float) -> int:
        """Time stamp `ts1` of a new request [ns]."""
        ts1 = int(now * 1e9)
        self._asked.append(ts1)
        return ts1

    def answer(self, tc1: int, ts1: int, now: float) -> bool:
        """Take a reply (both stamps in ns); False if it answers no request of ours."""
        if ts1 not in self._asked:
            return False
        self._asked.remove(ts1)
        sent = ts1 * 1e-9
        duration = now - sent
        if not 0.0 <= duration <= LONGEST:
            return False
        trip, best = RoundTrip(tc1 * 1e-9 - (sent + now) / 2.0, duration), self.best
        if (
            best is not None
            and abs(trip.offset - best.offset) > (trip.duration + best.duration) / 2.0 + 0.01
        ):
            self.resets += abs(trip.offset - best.offset) > REBOOT
            self._restart()
        self._trips.append(trip)
        return True

    def stamp(self, boot_ms: int, arrival: float) -> float:
        """Our time [s] of a vehicle's `time_boot_ms`, never later than its arrival.

        Before the first round trip it is the arrival itself.
        """
        boot = boot_ms / 1000.0
        last, self._last_boot = self._last_boot, boot
        if last is not None and REBOOT < last - boot < WRAP / 2.0:
            self.resets += 1
            self._restart()
        best = self.best
        if best is None:
            return arrival
        expected = arrival + best.offset
        boot += WRAP * round((expected - boot) / WRAP)
        return min(boot - best.offset, arrival)

    def _restart(self) -> None:
        self.jumps += 1
        self._trips.clear()
