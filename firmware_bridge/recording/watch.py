"""Watches a recorded robot: its commands, whether it follows them, and how late."""

from __future__ import annotations

import math
from collections import deque
from statistics import median

from firmware_bridge.messages import STILL, Speeds, State
from firmware_bridge.recording.answer import Answer, AnswerMeter, add
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import GateState
from firmware_bridge.safety.limits import Limits

Command = Speeds
CAR = ', or a car, which cannot turn on the spot: robot.wheels = {kind = "car", ...}'
"""What else it may be if it does not turn."""
WAYS = {
    "drive": "forward it goes back",
    "turn": "left it turns right",
    "drive sideways": "left it goes right",
}
EVERY = 1.0
"""How often it is judged [s]."""
LIKENESS = 0.7
"""Correlation of motion and commands from which on the motion counts as an answer."""
MOVES = 0.05
"""Smallest share of the commanded motion."""
REMEMBERED = 15
"""Measured delays of which the median counts."""


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
        self.trouble = ""
        """Why the robot must be stopped, in words; empty while nothing is wrong."""

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
