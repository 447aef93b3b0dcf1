"""What the control loop reports to observers, and the requests that it takes from people."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from firmware_bridge.messages import LinkStatus, State
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import GateState


class Observer(Protocol):
    """Sees each tick, as a recorder does; must return at once."""

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in what was done at `now` [s].

        `sent` tells whether v and omega went on the wire, `fresh` whether a plan went out for the
        first time.
        """


class Operator(Protocol):
    """Gives the requests of people: see estop.py."""

    def take(self) -> set[str]:
        """Give the requests since the last call: any of stop, reset, enable, confirm."""

    def tell(self, state: GateState, why: tuple[str, ...], barred: str) -> None:
        """Learn what the gate is doing, what is wrong, and why `enable` would be refused."""


@dataclass(frozen=True)
class Change:
    """The gate went from one state to another."""

    time: float  # on the loop's clock [s]
    before: GateState
    after: GateState
    why: tuple[str, ...]  # what was wrong then


@dataclass(frozen=True)
class Snapshot:
    """What the loop did last, for displays in other threads."""

    now: float
    state: State | None
    status: LinkStatus
    output: GateOutput
