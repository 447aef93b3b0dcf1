"""Watches a recorded robot: its commands, whether it follows them, how late, and how far."""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from firmware_bridge.messages import STILL, Speeds, State
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_settings import Limits
from firmware_bridge.safety.gate_table import GateState

WINDOW = 1.0  # time over which motion and commands are compared [s]: the pose's noise weighs little
LONGEST = 2.0  # latest answer that is looked for [s]
RECENT = 6.0  # motion that lies longer ago is forgotten [s]
LEAST = 1.0  # commanded motion at the largest speed before anything is reported [s]
Command = Speeds
CAR = ', or a car, which cannot turn on the spot: robot.wheels = {kind = "car", ...}'
"""What else it may be if it does not turn."""
WAYS = {
    "drive": "forward it goes back",
    "turn": "left it turns right",
    "drive sideways": "left it goes right",
}
EVERY = 1.0  # how often it is judged [s]
LIKENESS = 0.7  # correlation of motion and commands from which on the motion counts as an answer
MOVES = 0.05  # smallest share of the commanded motion
REMEMBERED = 15  # measured delays of which the median counts


class Answer(NamedTuple):
    """One speed's answer."""

    told: float  # recently commanded motion [m or rad]
    gain: float  # share of it that the robot went; negative: the other way
    likeness: float  # correlation of commanded and measured motion, -1 to 1
    delay: float  # how late it answers [s]


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


class DriveWatch:
    """An observer of the loop: it rates the robot's answers, and keeps the commands by the row.

    `period`: of the rows [s]. `limits`: largest commanded speeds. `by_hand`: somebody else drives:
    the measured speeds stand in for the commands, and nothing is judged.
    """

    def __init__(self, period: float, limits: Limits, by_hand: bool = False) -> None:
        self._period, self._by_hand = period, by_hand
        largest = max(limits.v_max, limits.v_reverse), limits.omega_max, limits.sideways
        self._meter = AnswerMeter(period, largest)
        self._delays: deque[float] = deque(maxlen=REMEMBERED)
        self._sum, self._since, self._last = STILL, 0.0, 0.0
        self._driving = False
        self._judged = -math.inf
        self.stretches: list[list[Command]] = []
        """Mean commands on the wire, a row a period, of each stretch without an interruption."""
        self.trouble = ""  # why the robot must be stopped, in words; empty while nothing is wrong

    @property
    def delay(self) -> float | None:
        """How late the robot answers, as far as it is known [s]."""
        return median(self._delays) if self._delays else None

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in one tick of the loop."""
        driving = self._by_hand or output.state is GateState.ACTIVE
        if not driving or state is None:
            self._driving = False
            return
        if not self._driving:
            self._begin(now, state)
            return
        dt, self._last = now - self._last, now
        by_hand = state.v, state.omega, state.vy
        speeds = by_hand if self._by_hand else output.speeds
        self._sum = add(self._sum, speeds, dt)
        if now - self._since >= self._period - 1e-6:
            held = now - self._since
            command = add(STILL, self._sum, 1.0 / held)
            self._meter.add(state, command)
            self.stretches[-1].append(command)
            self._sum, self._since = STILL, now
        due = now - self._judged >= EVERY
        if due and not self._by_hand and not self.trouble:
            self._judged = now
            self.trouble = self._judge()

    def _begin(self, now: float, state: State) -> None:
        self._driving, self._judged = True, now
        self._sum, self._since, self._last = STILL, now, now
        self._meter.forget()
        self._meter.add(state, STILL)
        self.stretches.append([])

    def _judge(self) -> str:
        """Say what is wrong, if anything is; a pose that stays is found by the gate's `Unmoved`."""
        speed, turn = self._meter.speed(), self._meter.turn()
        wrong = self._wrong(speed, "drive", "m") or self._wrong(turn, "turn", "rad")
        if wrong := wrong or self._wrong(self._meter.aside(), "drive sideways", "m"):
            return wrong
        known = [a.delay for a in (speed, turn) if a is not None and a.likeness > LIKENESS]
        if known:
            self._delays.append(max(known))
        return ""

    def _wrong(self, answer: Answer | None, verb: str, unit: str) -> str:
        if answer is None:
            return ""
        if answer.likeness < -LIKENESS and answer.gain < -MOVES:
            ways = WAYS[verb]
            return (
                f"commanded to {verb} {ways}, and vice versa, {-answer.gain:.2f} of the command: "
                "motors exchanged or inverted, or a pose of another frame"
            )
        moved = abs(answer.gain) * abs(answer.likeness) > MOVES
        if self._meter.is_long and not moved:
            return (
                f"commanded to {verb} {answer.told:.2g} {unit} recently, it hardly moved "
                f"({100 * abs(answer.gain):.0f} % of it): motors off, stuck, poses of something "
                f"else{CAR if verb == 'turn' else ''}"
            )
        return ""
