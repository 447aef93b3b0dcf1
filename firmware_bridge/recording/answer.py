"""How late, and how far, a robot follows its commands: from its poses while it drives."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from typing import NamedTuple

from firmware_bridge.messages import STILL, Speeds, State

WINDOW = 1.0
"""Time over which motion and commands are compared [s]: the pose's noise weighs little."""
LONGEST = 2.0
"""Latest answer that is looked for [s]."""
RECENT = 6.0
"""Motion that lies longer ago is forgotten [s]."""
LEAST = 1.0
"""Commanded motion at the largest speed before anything is reported [s]."""


class Answer(NamedTuple):
    """One speed's answer."""

    told: float
    """Recently commanded motion [m or rad]."""
    gain: float
    """Share of it that the robot went; negative: the other way."""
    likeness: float
    """Correlation of commanded and measured motion, -1 to 1."""
    delay: float
    """How late it answers [s]."""


class AnswerMeter:
    """Compares commands on the wire with the motion that the poses show: each of three speeds.

    `period`: between two samples [s]. `largest`: largest commanded speed [m/s], turn rate [rad/s],
    and speed to the left [m/s].
    """

    def __init__(self, period: float, largest: Speeds) -> None:
        self._period, self._largest = period, largest
        self._lags = round(LONGEST / period)
        self._span = max(1, round(WINDOW / period))
        self._first = self._span + self._lags
        self._told: deque[Speeds]
        self._done: deque[Speeds]
        self._last: State | None = None
        self.forget()

    def forget(self) -> None:
        """Begin anew with a robot that stands, after an interruption too."""
        size = round(RECENT / self._period) + self._first + 1
        still = [STILL] * (self._first + 1)
        self._told, self._done = deque(still, maxlen=size), deque(still, maxlen=size)
        self._last = None

    def add(self, state: State, command: Speeds) -> None:
        """Take in the pose at the end of a period, and the mean command in it."""
        before, self._last = self._last, state
        if before is None:
            return
        told, done = self._told[-1], self._done[-1]
        turn = math.remainder(state.theta - before.theta, math.tau)
        heading = before.theta + 0.5 * turn
        cos, sin = math.cos(heading), math.sin(heading)
        dx, dy = state.x - before.x, state.y - before.y
        self._told.append(add(told, command, self._period))
        self._done.append(add(done, (dx * cos + dy * sin, turn, dy * cos - dx * sin)))

    @property
    def is_long(self) -> bool:
        """Whether it has seen as much as it remembers: an answer would have come by now."""
        return len(self._told) == self._told.maxlen

    def speed(self) -> Answer | None:
        """Answer to v; None while too little was commanded."""
        return self._answer(0)

    def turn(self) -> Answer | None:
        """Answer to omega; None while too little was commanded."""
        return self._answer(1)

    def aside(self) -> Answer | None:
        """Answer to vy; None while too little was commanded."""
        return self._answer(2)

    def _answer(self, which: int) -> Answer | None:
        told = [row[which] for row in self._told]
        done = [row[which] for row in self._done]
        distance = sum(abs(b - a) for a, b in pairwise(told[self._first :]))
        if distance < LEAST * self._largest[which]:
            return None
        rows = range(self._first, len(told))
        moved = [done[k] - done[k - self._span] for k in rows]
        squares = sum(d * d for d in moved)
        best = Answer(distance, 0.0, 0.0, 0.0)
        for lag in range(self._lags + 1):
            asked = [told[k - lag] - told[k - lag - self._span] for k in rows]
            both = sum(a * d for a, d in zip(asked, moved, strict=True))
            size = sum(a * a for a in asked)
            likeness = both / math.sqrt(size * squares) if size * squares > 0.0 else 0.0
            if abs(likeness) > abs(best.likeness) + 1e-9:
                best = Answer(distance, both / size, likeness, lag * self._period)
        return best


def add(one: Speeds, other: Speeds, times: float = 1.0) -> Speeds:
    """Add speeds, so many times the other."""
    v, omega, vy = (a + times * b for a, b in zip(one, other, strict=True))
    return v, omega, vy
