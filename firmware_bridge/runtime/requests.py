"""What people ask for: stop, reset, enable, and that the board's frame was looked at."""

from __future__ import annotations

from collections.abc import Callable

from firmware_bridge.messages import LinkStatus
from firmware_bridge.runtime.observer import Operator
from firmware_bridge.runtime.statistics import Statistics
from firmware_bridge.safety.gate import SafetyGate
from firmware_bridge.safety.gate_table import GateState

WITHOUT_CONTROL = GateState.RELEASED, GateState.YIELDED, GateState.IDLE
"""States in which the board has to be asked for control before the robot drives."""


class Requests:
    """Passes the requests of an operator on to the gate and the driver.

    `operator`: sender of requests; none by default. `gate`: stops, resets and enables. `take`: asks
    the board for control again, where the operator enables the robot after it was given back or
    taken. `confirm`: tells the driver that the board's frame was looked at.
    """

    def __init__(
        self,
        operator: Operator | None,
        gate: SafetyGate,
        take: Callable[[], None] | None,
        confirm: Callable[[], None] | None,
    ) -> None:
        self._operator, self._gate, self._take, self._confirm = operator, gate, take, confirm

    def pass_on(
        self, status: LinkStatus, why: Callable[[], tuple[str, ...]], counts: Statistics
    ) -> None:
        """Tell the operator how things stand, and why; do what was asked for since."""
        if self._operator is None:
            return
        gate = self._gate
        self._operator.tell(gate.state, why(), _barred(status))
        for request in self._operator.take():
            if request == "confirm":
                if self._confirm is not None:
                    counts.guarded(self._confirm)
            elif request == "enable":
                self._enable(status, counts)
            else:
                {"stop": gate.estop, "reset": gate.reset}[request]()

    def _enable(self, status: LinkStatus, counts: Statistics) -> None:
        if status.frame_doubt:
            return
        if self._take is not None and self._gate.state in WITHOUT_CONTROL:
            counts.guarded(self._take)
        self._gate.enable()


def _barred(status: LinkStatus) -> str:
    """Why the robot may not be enabled, empty if it may."""
    if not status.frame_doubt:
        return ""
    return (
        f"{status.frame_doubt}: its frame may have moved; look where the robot is shown, then "
        "kmpc estop --confirm-frame"
    )
