"""Tells of a wheel whose counter stands while it is driven, and of one that runs away.

A counter stands if its encoder, or its motor, is dead. A wheel runs away if the lines of its
encoder are exchanged: the board's speed loop then pushes where it should brake.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field

PATIENCE = 1.0  # how long a driven wheel's counter may stand [s]: longer than any motor's lag
TRAVEL, COUNTS = 0.15, 3.0
"""Smallest commanded distance before that [m], or counts: a slow wheel may stick,
and a coarse encoder says little."""
SHARE = 0.02  # share of the commanded turn below which a counter stands


@dataclass
class Stretch:
    """Commanded and measured turn of a wheel since its counter moved last."""

    since: float = math.nan  # [s]
    asked: float = 0.0  # [rad]
    turned: float = 0.0  # [rad]


class DeadWheels:
    """Compares the commands of the wheels with their counters.

    `names`: of the wheels. `wheel_radius`: [m]. `count`: how far a wheel turns in a count of its
    encoder [rad].

    Examples
    --------
    >>> wheels = DeadWheels(("left", "right"), wheel_radius=0.05, count=0.01)
    >>> for k in range(120):
    ...     wheels.take((6.0, 6.0), (0.06, 0.0), 0.01 * k)
    >>> wheels.faults()[0][:48]
    'the right wheel is driven and its counter stands'
    """

    def __init__(self, names: tuple[str, ...], wheel_radius: float, count: float) -> None:
        self._names, self._farthest = names, max(TRAVEL / wheel_radius, COUNTS * count)
        self.forget()

    def forget(self) -> None:
        """Begin anew: the motors were let go, or the board was set up."""
        self._stretches = tuple(Stretch() for _ in self._names)
        self._last: float | None = None

    def take(self, asked: tuple[float, ...], turned: tuple[float, ...], now: float) -> None:
        """Take the commanded speeds of the wheels [rad/s], and how far they turned [rad].

        Since the last call; `now` is when the counters were read [s].
        """
        dt = 0.0 if self._last is None else max(0.0, now - self._last)
        self._last = now
        for stretch, speed, step in zip(self._stretches, asked, turned, strict=True):
            stretch.asked += speed * dt
            stretch.turned += step
            if not abs(stretch.turned) <= SHARE * abs(stretch.asked) or math.isnan(stretch.since):
                stretch.since, stretch.asked, stretch.turned = now, 0.0, 0.0

    def faults(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        return tuple(
            f"the {side} wheel is driven and its counter stands: is its encoder unplugged, or its "
            "motor off or blocked?"
            for side, stretch in zip(self._names, self._stretches, strict=True)
            if self._last is not None
            and abs(stretch.asked) >= self._farthest
            and self._last - stretch.since >= PATIENCE
        )


OVERSHOOT, MARGIN = 1.5, 0.25
"""Largest wheel speed relative to the command, plus this share of its top speed."""
LASTS = 0.2  # it runs away once it does so for this long [s]
HINT = "are the lines of its encoder or its motor exchanged?"


@dataclass
class Wheel:
    """Recent commands of a wheel."""

    asked: deque[tuple[float, float]] = field(default_factory=deque)  # when [s], and what [rad/s]
    wrong_since: float = math.inf  # [s]

    def excess(self, speed: float, now: float, margin: float) -> str:
        """What is wrong with a speed [rad/s], in words; empty if nothing is."""
        while self.asked[0][0] < now - PATIENCE:
            self.asked.popleft()
        slowest = min(speed for _, speed in self.asked)
        fastest = max(speed for _, speed in self.asked)
        largest = max(fastest, -slowest)
        if largest == 0.0:  # not driven: it is pushed, or rolls
            return ""
        if abs(speed) > OVERSHOOT * largest + margin:
            return "runs faster than commanded"
        whole = now - self.asked[0][0] >= 0.9 * PATIENCE
        if whole and slowest * fastest > 0.0 and speed * fastest < 0.0 and abs(speed) > margin:
            return "turns against its command"
        return ""


class RunawayWheels:
    """Compares the speeds of the wheels with their commands; a fault stays until `forget`.

    `names`: of the wheels. `top`: largest speed of a wheel [rad/s].

    Examples
    --------
    >>> wheels = RunawayWheels(("left", "right"), top=20.0)
    >>> for k in range(12):
    ...     wheels.take((6.0, 6.0), (6.1, 19.0), 0.02 * k)
    >>> wheels.faults()[0][:42]
    'the right wheel runs faster than commanded'
    """

    def __init__(self, names: tuple[str, ...], top: float) -> None:
        self._names, self._margin = names, MARGIN * top
        self.forget()

    def forget(self) -> None:
        """Begin anew: the motors were let go."""
        self._wheels = tuple(Wheel() for _ in self._names)
        self._faults: tuple[str, ...] = ()

    def faults(self) -> tuple[str, ...]:
        """What is wrong, in words."""
        return self._faults

    def take(self, asked: tuple[float, ...], speeds: tuple[float, ...], now: float) -> None:
        """Take the commands and the speeds of the wheels [rad/s]."""
        for side, wheel, wanted, speed in zip(
            self._names, self._wheels, asked, speeds, strict=True
        ):
            wheel.asked.append((now, wanted))
            words = wheel.excess(speed, now, self._margin)
            if not words:
                wheel.wrong_since = math.inf
                continue
            wheel.wrong_since = min(wheel.wrong_since, now)
            if now - wheel.wrong_since >= LASTS - 1e-6 and not self._faults:
                self._faults = (f"the {side} wheel {words}: {HINT}",)
