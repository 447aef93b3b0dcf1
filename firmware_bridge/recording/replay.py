"""What a recorded link log holds: a summary, a CSV to learn from, or a board to hear again."""

from __future__ import annotations

import math
import time
from collections import Counter
from pathlib import Path
from typing import Any

from firmware_bridge.link.server import serve
from firmware_bridge.messages import ConfigError, LinkError, State
from firmware_bridge.recording.durable import DurableFile
from firmware_bridge.recording.link_log import Chunk, play, read_link_log
from firmware_bridge.recording.recorder import (
    HEADER,
    HEADERS,
    REMARK,
    RowSampler,
    Tick,
    csv_row,
    torn_bytes,
)
from kmpc_lite.reading import open_regular

LISTENER_WAIT = 30.0
"""How long to wait for somebody to play to [s]; a pseudo-terminal cannot tell, and plays at
once."""

MAX_REMARK = 10_000
"""Longest remark before a CSV's header [bytes]."""


def replay(
    log: Path, csv: str | None, period: float, system: int, link: str | None, speed: float
) -> dict[str, Any]:
    """Read a link log, and do with it what is asked; gives what was found, for JSON.

    Parameters
    ----------
    log : Path
        A tlog or a raw log.
    csv : str, optional
        New file for the rows of a tlog.
    period : float
        Of the rows [s].
    system : int
        MAVLink id of the vehicle.
    link : str, optional
        Serve what came from the board on this URL, at `speed` times the recorded pace.
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
    if chunks[0].incoming is None:
        states, messages = decode_tlog(chunks, system)
        report |= {"messages": dict(messages.most_common()), "poses": len(states)}
        report["distance"] = round(
            sum(math.hypot(b.x - a.x, b.y - a.y) for a, b in zip(states, states[1:], strict=False)),
            3,
        )
        if csv is not None:
            report |= {"csv": csv, "rows": write_csv(Path(csv), states, period)}
    else:
        report["bytes_in"] = sum(len(c.data) for c in chunks if c.incoming)
        report["bytes_out"] = sum(len(c.data) for c in chunks if not c.incoming)
        if csv is not None:
            raise ConfigError(
                f"{log}: --csv needs a tlog; a raw log holds questions and answers, "
                "its CSV was recorded beside it"
            )
    if link is not None:
        report["served"] = serve_log(chunks, link, speed)
    return report


def inspect_csv(path: Path, mend: bool) -> dict[str, Any]:
    """Look at a recorded CSV; gives what was found, for JSON.

    With `mend`, what a power cut tore at its end is cut off.

    Raises
    ------
    ConfigError
        If the file is no CSV of a recorder: it is left as it is.
    """
    with open_regular(path) as file:
        first = file.readline(MAX_REMARK)
        if first.startswith(REMARK):
            first = file.readline(MAX_REMARK)
        if first not in HEADERS.values():
            raise ConfigError(
                f"{path}: no recorded CSV: expected {HEADER.decode().strip()} in its first line"
            )
        rows = sum(part.count(b"\n") for part in iter(lambda: file.read(2**20), b""))
    return {"log": str(path), "rows": rows, "torn_bytes": torn_bytes(path, mend), "mended": mend}


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


def serve_log(chunks: list[Chunk], url: str, speed: float) -> int:
    """Serve on a link what came from the board; returns the bytes that were taken."""
    transport, written = serve(url), 0
    transport.start(lambda data, stamp: None)
    try:
        until = time.monotonic() + LISTENER_WAIT
        while not transport.connected:
            if time.monotonic() > until:
                raise LinkError(f"{url}: no listener within {LISTENER_WAIT:g} s")
            time.sleep(0.02)
        for chunk in play(
            [c for c in chunks if c.incoming is not False], speed, time.monotonic, time.sleep
        ):
            written += len(chunk.data) if transport.write(chunk.data) else 0
        time.sleep(0.1)
    finally:
        transport.close()
    return written
