"""What a terminal shows while the robot drives; its own thread, since a terminal may block."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import TextIO

from firmware_bridge.runtime.loop import ControlLoop
from firmware_bridge.runtime.observer import Change, Snapshot
from firmware_bridge.runtime.timing import Histogram
from firmware_bridge.safety.gate_table import GateState

PERIOD, ENDED = 0.2, (GateState.RELEASED, GateState.YIELDED, GateState.ESTOP)
"""Between pictures [s]; states of which the user is told what goes on."""
BAR = 10  # half width of a speed's bar, in characters
UP, CLEAR = "\x1b[{}F", "\x1b[2K"
NO_WRAP, WRAP = "\x1b[?7l", "\x1b[?7h"
"""Lines are cut at the edge while drawing: a wrapped one would take two."""
RED, GREEN, BOLD, PLAIN = "\x1b[31m", "\x1b[32m", "\x1b[1m", "\x1b[0m"


class View:
    """Draws the newest state of a loop five times a second on a terminal.

    If there is no terminal it tells changes of state only.

    `loop`: what to show. `title`: driver and link. `out`: where to. `live`: whether `out` is a
    terminal to draw on. `notes`: gives lines that a user must see: a log that has ended. `more`:
    gives more lines for the picture.
    """

    def __init__(
        self,
        loop: ControlLoop,
        title: str,
        out: TextIO,
        live: bool,
        notes: Callable[[], list[str]] = list,
        more: Callable[[], list[str]] = list,
    ) -> None:
        self._more = more
        self._loop, self._title, self._out, self._live, self._notes = loop, title, out, live, notes
        self._told: set[str] = set()
        self._seen = 0
        self._lines = 0
        self._quit = threading.Event()
        self._thread = threading.Thread(target=self._run, name="bridge-view", daemon=True)

    def start(self) -> None:
        """Begin to draw."""
        self._thread.start()

    def stop(self) -> None:
        """Draw a last time and end; a terminal that blocks is left to itself."""
        self._quit.set()
        self._thread.join(1.0)

    def draw(self) -> None:
        """Draw once."""
        lines = [_change(c, self._loop.began) for c in self._new_changes()]
        lines += [note for note in self._notes() if note not in self._told]
        self._told.update(lines)
        text = UP.format(self._lines) if self._lines else ""
        text += "".join(f"{CLEAR if self._live else ''}{line}\n" for line in lines)
        if self._live and self._loop.snapshot is not None:
            picture = [*render(self._title, self._loop.snapshot, self._loop), *self._more()]
            text += NO_WRAP + "".join(f"{CLEAR}{line}\n" for line in picture) + WRAP
            self._lines = len(picture)
        if text:
            self._out.write(text)
            self._out.flush()

    def _new_changes(self) -> list[Change]:
        total, changes = self._loop.changes_total, list(self._loop.changes)
        new = changes[len(changes) - min(total - self._seen, len(changes)) :]
        self._seen = total
        return new

    def _run(self) -> None:
        try:
            while not self._quit.wait(PERIOD):
                self.draw()
            self.draw()
        except (OSError, ValueError):  # the terminal has gone; the robot drives on
            return


def _change(change: Change, began: float) -> str:
    why = f": {', '.join(change.why)}" if change.why else ""
    told = change.after in ENDED and (why or change.after is GateState.ESTOP)
    why += f": {change.after.value}" if told else ""
    return f"{change.time - began:8.2f} s  {change.before.name} -> {change.after.name}{why}"


def render(title: str, shot: Snapshot, loop: ControlLoop) -> list[str]:
    """Lines of one picture: state, pose, command, step time, link health, what is wrong."""
    state, status, output = shot.state, shot.status, shot.output
    limits, planner = loop.gate.settings.limits, loop.planner
    colour = GREEN if not output.reasons else RED
    lines = [
        f"{BOLD}kmpc{PLAIN}  {title}   {colour}{output.state.name}{PLAIN}  {output.state.value}"
    ]
    if state is None:
        lines.append("pose        none yet")
    else:
        lines.append(
            f"pose        x {state.x:8.3f} m   y {state.y:8.3f} m   theta {state.theta:7.3f} rad  "
            f" age {_ms(shot.now - state.stamp)}"
        )
    top = max(limits.v_max, limits.v_reverse)
    v_bar, omega_bar = _bar(output.v / top), _bar(output.omega / limits.omega_max)
    lines.append(
        f"command     v {output.v:7.3f} m/s {v_bar}   omega {output.omega:7.3f} rad/s {omega_bar}"
    )
    if output.vy:
        lines[-1] += f"   vy {output.vy:7.3f} m/s {_bar(output.vy / limits.sideways)}"
    failed = f"   failed {planner.errors}: {planner.last_error}" if planner.errors else ""
    lines.append(f"controller  {_times(planner.step_time)}{failed}")
    lines.append(f"latency     pose to wire {_times(loop.statistics.pose_to_wire)}")
    mode = f"{status.mode or '-'}, {'armed' if status.armed else 'not armed'}"
    lines.append(
        f"link        {'up' if status.connected else 'DOWN'}, "
        f"heard {_ms(shot.now - status.heartbeat_stamp)} ago, {mode}, {status.lost} bad or lost"
    )
    wrong = [*(r.value for r in output.reasons), *status.faults]
    lines.append(f"wrong       {RED}{'; '.join(wrong)}{PLAIN}" if wrong else "wrong       nothing")
    return lines


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:4.0f} ms" if seconds < 100.0 else "never"


def _times(times: Histogram) -> str:
    if not times.count:
        return "no step yet"
    return (
        f"{1e3 * times.quantile(0.5):.2f} ms median, {1e3 * times.quantile(0.99):.2f} p99, "
        f"{1e3 * times.maximum:.2f} max"
    )


def _bar(share: float) -> str:
    """Draw a share from -1 to 1 as a bar round a middle mark."""
    length = round(BAR * min(1.0, abs(share)))
    left, right = (length, 0) if share < 0 else (0, length)
    return "[" + " " * (BAR - left) + "#" * left + "|" + "#" * right + " " * (BAR - right) + "]"
