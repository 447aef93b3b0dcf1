"""How long a STOP on the live page takes: an emulated rover drives, and is stopped so often."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any

from firmware_bridge.messages import LinkError, State, VelocityCommand
from firmware_bridge.robot_file import load_robot
from firmware_bridge.runtime.observer import Snapshot
from firmware_bridge.runtime.session import Session
from firmware_bridge.safety.gate_table import GateState
from kmpc_lab.attacks.trial import child, free_port, input_of, live_page, shown, standstill, tell
from kmpc_lab.attacks.vehicle import SPEED, sections

PERIOD = 0.1
"""Of the controller [s]."""
TURNING = 0.3
"""The rover drives in circles, so that it stays where it is [rad/s]."""
CRUISE = 0.7
"""How long it drives at its speed before each press [s]."""
REST = 1.5
"""For the last stop to be seen in the trace [s]."""
PATIENCE = 30.0
"""For each drive to begin, and each stop to be obeyed [s]."""


@dataclass(frozen=True)
class Press:
    """One STOP, from the click on."""

    gate: float
    """Until the gate obeys: from then on its commands only brake [s]."""
    zero: float
    """From the click until its command is zero [s]."""
    stands: float
    """From the click until the rover stands, by the trace of its emulator [s]."""
    confirmed: float
    """From the click until the page could say so: the stop is on disk by then [s]."""


class Script:
    """Asked once a tick: has STOP pressed while the robot drives, and notes what the gate does."""

    def __init__(
        self, count: int, press: Callable[[], None], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self._left, self._press, self._clock = count, press, clock
        self._since = self._fast = clock()
        self._pressed = False
        self._obeyed = math.nan
        self.seen: list[tuple[float, float]] = []
        """When the gate obeyed, and when its command was zero, of each press [s]."""

    def __call__(self, shot: Snapshot | None) -> bool:
        """Take what the last tick left; return whether all is done, or nothing happens any more."""
        now = self._clock()
        if shot is None:
            return False
        driving = shot.output.state is GateState.ACTIVE and shot.output.v > 0.95 * SPEED
        if not driving:
            self._fast = now
        if not self._pressed and now - self._fast > CRUISE:
            self._pressed, self._obeyed, self._since = True, math.nan, now
            self._press()
        elif self._pressed and shot.output.state is GateState.ESTOP:
            if math.isnan(self._obeyed):
                self._obeyed = shot.now
            if shot.output.v == shot.output.omega == 0.0:
                self.seen.append((self._obeyed, shot.now))
                self._pressed, self._since = False, now
                self._left -= 1
        return now - self._since > (PATIENCE if self._left else REST)


def run(count: int) -> list[Press]:
    """Press STOP `count` times on the page of a rover that drives.

    Raises
    ------
    LinkError
        If the rover did not drive, or the gate did not obey.
    """
    with tempfile.TemporaryDirectory(prefix="kmpc-presses-") as name, ExitStack() as stack:
        folder = Path(name)
        url, path = f"tcp:127.0.0.1:{free_port('tcp')}", folder / "estop"
        trace = folder / "trace"
        vehicle = stack.enter_context(child("vehicle", "mavlink", url, "", str(trace), "", ""))
        page = stack.enter_context(live_page(path))
        finger = stack.enter_context(child("finger", page.links[0], str(path)))
        robot = load_robot(None, sections("mavlink", url, socket=str(path)))
        with Session(robot, _circle, PERIOD) as session:
            page.start(lambda: shown(session), {"title": "a robot that is stopped"})
            script = Script(count, lambda: tell([input_of(finger)], "on"))
            session.drive(lambda: script(session.loop.snapshot))
            why = ", ".join(session.why()) or "no reason was given"
        if len(script.seen) < count:
            raise LinkError(f"press {len(script.seen) + 1}: it did not drive, or stop: {why}")
        input_of(vehicle).close()
        vehicle.wait()
        assert finger.stdout is not None
        return [_press(finger.stdout, trace, *seen) for seen in script.seen]


def _press(lines: IO[str], trace: Path, obeyed: float, zero: float) -> Press:
    """Put together what the finger, the gate and the rover's trace say of a press."""
    clicked, confirmed = map(float, lines.readline().split())
    stands = obeyed - clicked + standstill(trace, obeyed)
    gate = max(0.0, obeyed - clicked)  # it may hear in the tick that has just begun
    return Press(gate, max(0.0, zero - clicked), stands, confirmed - clicked)


def _circle(state: State) -> VelocityCommand:
    return VelocityCommand(SPEED, TURNING, time.monotonic())


def summary(presses: Sequence[Press]) -> dict[str, dict[str, float]]:
    """Median and longest of each time [s]."""
    found = {}
    for name in ("gate", "zero", "stands", "confirmed"):
        times = sorted(getattr(press, name) for press in presses)
        found[name] = {"p50": round(times[len(times) // 2], 4), "max": round(times[-1], 4)}
    return found


def as_dict(presses: Sequence[Press]) -> dict[str, Any]:
    """Each press and their summary, for machines [s]."""
    each = [{name: round(value, 4) for name, value in vars(p).items()} for p in presses]
    return {"presses_s": each, **summary(presses)}


def told(presses: Sequence[Press]) -> str:
    """Put the times into words."""
    words = {
        "gate": "from the click until the gate brakes",
        "zero": "until its command is zero",
        "stands": "until the rover stands",
        "confirmed": "until the page says so",
    }
    return "\n".join(
        f"{words[name]:<38} p50 {1e3 * row['p50']:5.0f} ms, longest {1e3 * row['max']:5.0f} ms"
        for name, row in summary(presses).items()
    )
