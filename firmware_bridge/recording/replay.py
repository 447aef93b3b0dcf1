"""What a recorded tlog holds: a summary, or a CSV to learn from."""

from __future__ import annotations

import math
from collections import Counter
from pathlib import Path
from typing import Any

from firmware_bridge.messages import ConfigError, State
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.link_log import Chunk, read_link_log
from firmware_bridge.recording.recorder import (
    HEADER,
    RowSampler,
    Tick,
    csv_row,
)


def replay(log: Path, csv: str | None, period: float, system: int) -> dict[str, Any]:
    """Read a tlog, and make a CSV of it if asked; gives what was found, for JSON.

    Parameters
    ----------
    log : Path
        A tlog.
    csv : str, optional
        New file for the rows of a tlog.
    period : float
        Of the rows [s].
    system : int
        MAVLink id of the vehicle.
    """
    chunks = list(read_link_log(log))
    if not chunks:
        raise ConfigError(f"{log}: no whole record in it")
    report: dict[str, Any] = {
        "log": str(log),
        "records": len(chunks),
        "seconds": round(chunks[-1].time - chunks[0].time, 3),
        "longest_gap": round(
            max((b.time - a.time for a, b in zip(chunks, chunks[1:], strict=False)), default=0.0), 3
        ),
    }
    states, messages = decode_tlog(chunks, system)
    report |= {"messages": dict(messages.most_common()), "poses": len(states)}
    steps = zip(states, states[1:], strict=False)
    report["distance"] = round(sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in steps), 3)
    if csv is not None:
        report |= {"csv": csv, "rows": write_csv(Path(csv), states, period)}
    return report


def decode_tlog(chunks: list[Chunk], system: int) -> tuple[list[State], Counter[str]]:
    """Poses of the vehicle, and how many messages of each kind the log holds, of whomever."""
    from firmware_bridge.drivers.mavlink.codec import MavlinkCodec
    from firmware_bridge.drivers.mavlink.core import MavlinkCore
    from firmware_bridge.drivers.mavlink.options import MavlinkOptions

    core = MavlinkCore(MavlinkOptions(system=system), lambda frame: None, 0.0)
    codec, messages, states = MavlinkCodec(255, 190), Counter[str](), list[State]()
    for chunk in chunks:
        messages.update(message.get_type() for message in codec.feed(chunk.data, chunk.time))
        core.receive(chunk.data, chunk.time)
        if core.state is not None and (not states or core.state.stamp > states[-1].stamp):
            states.append(core.state)
    return states, messages


def write_csv(path: Path, states: list[State], period: float) -> int:
    """Write poses and measured speeds on an even grid; gives the number of rows."""
    file: DurableFile[bytes] = DurableFile(path, list, HEADER)
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
