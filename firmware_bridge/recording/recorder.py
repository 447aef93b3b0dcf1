"""Records a drive in a CSV that `kmpc fit` reads."""

from __future__ import annotations

import json
import math
from collections import deque
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from firmware_bridge.messages import STILL, Speeds, State
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.safety.gate import GateOutput
from firmware_bridge.safety.gate_table import DRIVING
from firmware_bridge.wheels import COLUMNS, TWO_SIDES, Wheels

REMARK = b"# vehicle "
"""A remark before the header says whose log it is, in JSON."""
LATENESS = 0.3
"""A row is written this long after its time [s]: by then its pose has come, or the robot was
stopped for the lack of it."""
POSE_GAP = 0.25
"""Poses farther apart [s] are not interpolated: the row is left out, and the episode ends."""
HEADERS = {
    kind: (",".join(("t", "x", "y", "theta", *columns)) + "\n").encode()
    for kind, columns in COLUMNS.items()
}
"""First line, by kind of wheels."""
HEADER = HEADERS[TWO_SIDES.kind]


class Tick(NamedTuple):
    """One tick of the loop, as far as a log wants it."""

    now: float  # [s]
    state: State | None
    command: Speeds | None  # what was sent in this tick
    driven: bool  # whether the robot is to be recorded: it obeys our commands
    fresh: bool = False  # whether the command is the first of a new plan


class RowSampler:
    """Puts a drive on an even grid: the pose at each row, and the mean command until the next.

    Rows begin when a plan's command begins, so that with the controller's period a row holds one
    command. Wherever the drive is interrupted the time jumps by three periods or more, which ends
    an episode for `kmpc fit`.

    `period`: of the rows [s]. `by_hand`: somebody else drives: the measured speeds stand in for the
    commands. `wheels`: of the robot: they say what numbers a command has.
    """

    def __init__(self, period: float, by_hand: bool = False, wheels: Wheels = TWO_SIDES) -> None:
        self.period, self.by_hand, self._wheels = period, by_hand, wheels
        self._poses: deque[State] = deque(maxlen=256)
        self._commands: deque[tuple[float, Speeds]] = deque(maxlen=256)
        self._origin: float | None = None
        self._next: float | None = None  # time of the next row [s]; None between episodes
        self._last_row = -math.inf

    def take(self, tick: Tick) -> list[tuple[float, ...]]:
        """Take in one tick and give the rows that are now whole: t, x, y, theta, command."""
        if tick.state is not None and (not self._poses or tick.state.stamp > self._poses[-1].stamp):
            self._poses.append(tick.state)
        if tick.command is not None:
            self._commands.append((tick.now, tick.command))
        if not tick.driven:
            return self.finish(tick.now)
        if self._next is not None:
            return self._rows(tick.now - LATENESS)
        if (
            self._poses
            and (self.by_hand or tick.fresh)
            and tick.now >= self._last_row + 3.0 * self.period - 1e-9
        ):
            self._origin = tick.now if self._origin is None else self._origin
            self._next = tick.now
        return []

    def finish(self, until: float) -> list[tuple[float, ...]]:
        """End an episode at `until` [s] and give its last rows."""
        rows = [] if self._next is None else self._rows(until)
        self._next = None
        return rows

    def _rows(self, until: float) -> list[tuple[float, ...]]:
        """Rows whose period is over by `until` [s]."""
        assert self._origin is not None
        rows: list[tuple[float, ...]] = []
        while self._next is not None and self._next + self.period <= until + 1e-9:
            pose = self._pose(self._next)
            command = self._command(self._next, self._next + self.period)
            if pose is None or command is None:
                self._next = max(self._next + self.period, self._last_row + 3.0 * self.period)
                continue
            rows.append((self._next - self._origin, *pose, *command))
            self._last_row, self._next = self._next, self._next + self.period
        return rows

    def _pose(self, time: float) -> tuple[float, float, float] | None:
        """Interpolate the pose at a time [s]; None across gaps and outside of what was recorded."""
        after = None
        for before in reversed(self._poses):
            if before.stamp > time:
                after = before
                continue
            if (
                after is None
                or after.stamp - before.stamp > POSE_GAP
                or not (_finite(before) and _finite(after))
            ):
                return None
            share = (time - before.stamp) / (after.stamp - before.stamp)
            turn = math.remainder(after.theta - before.theta, math.tau)
            return (
                before.x + share * (after.x - before.x),
                before.y + share * (after.y - before.y),
                before.theta + share * turn,
            )
        return None

    def _command(self, start: float, end: float) -> tuple[float, ...] | None:
        """Mean command from `start` to `end` [s]; None if it is not known all that time."""
        held = (
            [(s.stamp, (s.v, s.omega, s.vy)) for s in self._poses if _finite(s)]
            if self.by_hand
            else list(self._commands)
        )
        sums, covered, curvature = [0.0] * len(self._wheels.columns), 0.0, 0.0
        for (begin, speeds), (finish, _) in zip(held, [*held[1:], (math.inf, STILL)], strict=True):
            values = self._wheels.row(speeds, curvature)
            curvature = values[1]
            overlap = min(finish, end) - max(begin, start)
            if overlap > 0.0:
                sums = [total + overlap * v for total, v in zip(sums, values, strict=True)]
                covered = covered + overlap
        if covered < 0.99 * (end - start):
            return None
        return tuple(total / covered for total in sums)


class CsvRecorder:
    """Records the rows of a `RowSampler` in a new file; an `Observer` of the loop.

    `path`: of a new .csv file. `period`, `by_hand`: see `RowSampler`. `vehicle`: what the log is to
    say of the vehicle. `wheels`: of the robot: they say what numbers a command has.
    """

    def __init__(
        self,
        path: Path,
        period: float,
        by_hand: bool = False,
        vehicle: Mapping[str, Any] | None = None,
        wheels: Wheels = TWO_SIDES,
    ) -> None:
        self._sampler = RowSampler(period, by_hand, wheels)
        self._last = -math.inf
        remark = REMARK + json.dumps(vehicle).encode() + b"\n" if vehicle else b""
        header = remark + HEADERS[wheels.kind]
        self.file: DurableFile[Tick | None] = DurableFile(path, self._encode, header)

    @property
    def rows(self) -> int:
        """Rows in the file so far."""
        return max(0, self.file.written)

    def on_tick(
        self, now: float, state: State | None, output: GateOutput, sent: bool, fresh: bool
    ) -> None:
        """Take in one tick of the loop."""
        self._last = now
        driven = self._sampler.by_hand or output.state in DRIVING
        self.file.put(Tick(now, state, output.speeds if sent else None, driven, fresh))

    def close(self) -> None:
        """Write the last rows."""
        self.file.put(None)
        self.file.close()

    def _encode(self, ticks: Iterable[Tick | None]) -> list[bytes]:
        rows: list[tuple[float, ...]] = []
        for tick in ticks:
            rows += self._sampler.finish(self._last) if tick is None else self._sampler.take(tick)
        return list(map(csv_row, rows))


def _finite(state: State) -> bool:
    return all(map(math.isfinite, (state.x, state.y, state.theta, state.v, state.omega, state.vy)))


def csv_row(row: Iterable[float]) -> bytes:
    """Render one row."""
    return (",".join(f"{value:.6f}" for value in row) + "\n").encode()
