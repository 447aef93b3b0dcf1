"""A robot that does not move when commanded to: frozen poses, dead encoders, motors off."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from firmware_bridge.messages import Speeds, State
from firmware_bridge.safety.gate_table import GateState

Pose = tuple[float, float, float]
TOLD_OF = GateState.STOPPING, GateState.HOLDING, GateState.RELEASED
"""States in which a robot that did not move is still reported: until it is enabled again."""


@dataclass(frozen=True)
class UnmovedOptions:
    """When a robot counts as one that does not move."""

    patience: float = 1.0
    """How long it may take to answer [s]: longer than any robot's lag; 0: for ever."""
    travel: float = 0.15  # smallest commanded distance before that [m]; noise of a pose is far less
    turn: float = 1.0  # or to turn so far [rad]: a skid-steer robot may stick at a slow turn
    share: float = 0.1  # share of the commanded motion below which a robot does not move
    every: float = 0.1  # between two poses that are remembered [s]
    remembered: int = 200  # how many of them: they reach back far enough for a robot that creeps
    stall: float = 0.3
    """Longest time between two looks; after a longer one the motion is unknown [s]."""


class Moment(NamedTuple):
    """Commanded and measured motion up to a time."""

    now: float  # [s]
    told: Pose  # where the commands alone lead [m, m, rad]; headings are not wrapped
    seen: Pose  # the measured pose


class Unmoved:
    """Compares, while the robot drives, the commanded motion with the change of its pose.

    `options`: see there.

    Examples
    --------
    >>> watch, here = Unmoved(UnmovedOptions()), State(0.0, 0.0, 0.0, 0.3, 0.0, 0.0)
    >>> words = [watch.look(GateState.ACTIVE, 0.02 * k, (0.3, 0.0, 0.0), here) for k in range(81)]
    >>> words[70], words[75]
    ('', 'commanded to drive 0.15 m, it moved 0.00 m in 1.5 s, by its pose')
    """

    def __init__(self, options: UnmovedOptions) -> None:
        self._options = options
        self._told: Pose = (0.0, 0.0, 0.0)
        self._last: float | None = None
        self._moments: deque[Moment] = deque(maxlen=options.remembered)
        self._words = ""

    def look(self, gate: GateState, now: float, held: Speeds, state: State | None) -> str:
        """Take in the speeds that were held since the last look, and the newest pose.

        Gives why the robot must be stopped, in words; empty if nothing is wrong.
        """
        if gate is GateState.ACTIVE:
            self._words = self._drive(now, held, state)
            return self._words
        self._rest()
        if gate not in TOLD_OF:
            self._words = ""
        return self._words

    def _rest(self) -> None:
        self._last = None
        self._moments.clear()

    def _drive(self, now: float, held: Speeds, state: State | None) -> str:
        dt = 0.0 if self._last is None else now - self._last
        if not 0.0 <= dt <= self._options.stall:
            self._rest()
            dt = 0.0
        self._last = now
        x, y, heading = self._told
        ahead, turn, left = (speed * dt for speed in held)
        cos, sin = math.cos(heading + 0.5 * turn), math.sin(heading + 0.5 * turn)
        self._told = x + ahead * cos - left * sin, y + ahead * sin + left * cos, heading + turn
        before = self._moments[-1] if self._moments else None
        due = before is None or now - before.now >= self._options.every - 1e-6
        if not (due and self._options.patience) or state is None:
            return ""
        theta = state.theta
        if not all(map(math.isfinite, (state.x, state.y, theta))):
            return ""
        if before is not None:
            theta = before.seen[2] + math.remainder(theta - before.seen[2], math.tau)
        self._moments.append(Moment(now, self._told, (state.x, state.y, theta)))
        return self._judge()

    def _judge(self) -> str:
        """Look whether commands old enough were ever answered."""
        o, moments = self._options, list(self._moments)
        until = moments[-1].now - o.patience + 1e-6
        told = [moment for moment in moments if moment.now <= until]
        return _unanswered(
            moments,
            told,
            _distance,
            o.travel,
            o.share,
            "commanded to drive {:.2f} m, it moved {:.2f} m",
        ) or (
            _unanswered(
                moments,
                told,
                _turn,
                o.turn,
                o.share,
                "commanded to turn {:.2f} rad, it turned {:.2f} rad",
            )
        )


def _distance(a: Pose, b: Pose) -> float:
    return math.dist(a[:2], b[:2])


def _turn(a: Pose, b: Pose) -> float:
    return abs(b[2] - a[2])


def _unanswered(
    moments: list[Moment],
    told: list[Moment],
    change: Callable[[Pose, Pose], float],
    least: float,
    share: float,
    words: str,
) -> str:
    """Compare the newest commanded change that is large enough with the measured one."""
    for k in range(len(told) - 2, -1, -1):
        begin, wanted = told[k], change(told[k].told, told[-1].told)
        if wanted < least:
            continue
        came = max(change(begin.seen, moment.seen) for moment in moments[k:])
        if came >= share * wanted:
            return ""
        seconds = moments[-1].now - begin.now
        return f"{words.format(wanted, came)} in {seconds:.1f} s, by its pose"
    return ""
