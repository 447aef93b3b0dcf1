"""What a recorded tlog holds: a summary, or a CSV to learn from."""

from __future__ import annotations

import math
from collections import Counter
from itertools import pairwise
from pathlib import Path
from typing import Any

from firmware_bridge.messages import ConfigError, State
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.recorder import HEADER, RowSampler, Tick, csv_row
from kmpc_lite.learn.formats.ardupilot import frames


def replay(log: Path, csv: str | None, period: float, system: int) -> dict[str, Any]:
    """Read a tlog, and make a CSV of it if asked; gives what was found, for JSON.

    `log`: a tlog; what is no frame in it is passed over. `csv`: new file for the rows of a tlog.
    `period`: of the rows [s]. `system`: MAVLink id of the vehicle. Raises ConfigError if the log
    cannot be read, or holds no frame.
    """
    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
    from firmware_bridge.drivers.mavlink.core import MavlinkCore
    from firmware_bridge.drivers.mavlink.options import MavlinkOptions

    core = MavlinkCore(MavlinkOptions(system=system), lambda frame: None, 0.0)
    codec, messages, states = MavlinkCodec(255, 190), Counter[str](), list[State]()
    first = last = None
    gap = 0.0
    try:
        for time, _, frame in frames(log):
            messages.update(message.get_type() for message in codec.feed(frame, time))
            core.receive(frame, time)
            if core.state is not None and (not states or core.state.stamp > states[-1].stamp):
                states.append(core.state)
            gap = gap if last is None else max(gap, time - last)
            first, last = time if first is None else first, time
    except OSError as error:
        raise ConfigError(f"{log}: cannot read: {error.strerror or error}") from error
    if first is None or last is None or not messages:
        raise ConfigError(f"{log}: no MAVLink frame in it: not a tlog, or empty")
    way = sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in pairwise(states))
    report = {
        "log": str(log),
        "records": messages.total(),
        "seconds": round(last - first, 3),
        "longest_gap": round(gap, 3),
        "messages": dict(messages.most_common()),
        "poses": len(states),
        "distance": round(way, 3),
    }
    return report if csv is None else {**report, "csv": csv, "rows": _write(csv, states, period)}


def _write(csv: str, states: list[State], period: float) -> int:
    """Write poses and measured speeds on an even grid; gives the number of rows."""
    file: DurableFile[bytes] = DurableFile(Path(csv), list, HEADER)
    sampler, rows = RowSampler(period, by_hand=True), []
    for state in states:
        rows += sampler.take(Tick(state.stamp, state, None, True))
    if states:
        rows += sampler.finish(states[-1].stamp)
    for row in rows:
        file.put(csv_row(row))
    file.close()
    if file.problem:
        raise ConfigError(file.problem)
    return len(rows)
