"""What a busy computer costs a drive: cores that calculate, a disk that writes.

The same drive on a computer that has nothing else to do, on a busy one, and on a busy one with
real-time priority (`kmpc run --realtime`), in turns.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

BURN = "while True: pass"
WRITE = """\
import os, sys
block = os.urandom(2**20)
while True:
    with open(sys.argv[1], "wb") as file:
        for _ in range(64):
            file.write(block)
            file.flush()
            os.fsync(file.fileno())
"""
"""64 MB in pieces that each reach the disk, again and again."""
TIMES = ("controller", "gate period, late by")


@dataclass(frozen=True)
class Mode:
    """How a drive is run."""

    name: str
    busy: bool
    realtime: bool


MODES = (
    Mode("nothing else runs", busy=False, realtime=False),
    Mode("busy", busy=True, realtime=False),
    Mode("busy, real-time priority", busy=True, realtime=True),
)


@contextmanager
def busy(folder: Path) -> Iterator[None]:
    """Keep as many processes calculating as there are cores, and one writing into a folder."""
    file = folder / "written"
    jobs = [[BURN]] * (os.cpu_count() or 1) + [[WRITE, str(file)]]
    with ExitStack() as stack:
        for job in jobs:
            child = subprocess.Popen([sys.executable, "-c", *job])
            stack.callback(child.wait)
            stack.callback(child.kill)
        yield
    file.unlink(missing_ok=True)


def measure(
    drive: Callable[[Mode], dict[str, Any]],
    drives: int,
    folder: Path,
    say: Callable[[str], None] = lambda text: None,
    modes: Sequence[Mode] = MODES,
) -> list[dict[str, Any]]:
    """Drive in each mode in turn; a row for each mode.

    Parameters
    ----------
    drive : callable
        Drives in a mode and gives the report of `kmpc run --json`.
    drives : int
        In each mode.
    folder : Path
        On the disk that is to be busy.
    say : callable
        Takes what is under way.
    """
    reports: dict[str, list[dict[str, Any]]] = {mode.name: [] for mode in modes}
    for number in range(drives):
        for mode in modes:
            say(f"{mode.name}: drive {number + 1} of {drives}")
            with ExitStack() as stack:
                if mode.busy:
                    stack.enter_context(busy(folder))
                reports[mode.name].append(drive(mode))
    return [{"computer": name, **_row(found)} for name, found in reports.items()]


def _row(reports: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """What drives of one mode have in common; times are the medians over drives [ms]."""
    loops = [report["loop"] for report in reports]
    arrived = [report["arrived_after_s"] for report in reports if report["arrived_after_s"]]
    return {
        "drives": len(reports),
        "arrived": sum(report["outcome"] == "arrived" for report in reports),
        "arrived_after_s": median(arrived) if arrived else None,
        "least_clearance_m": min(report["clearance_m"] for report in reports),
        "controller_periods_skipped": sum(loop["controller_periods_skipped"] for loop in loops),
        "times_ms": {
            name: {
                share: median(loop["times_ms"][name][share] for loop in loops)
                for share in ("p50", "p99", "max")
            }
            for name in TIMES
        },
    }


def told(rows: Sequence[dict[str, Any]]) -> str:
    """Table in Markdown."""
    lines = [
        "| computer | arrived | after [s] | least clearance [cm] | controller p50, p99, max [ms] "
        "| gate late p50, p99, max [ms] | plans skipped |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for row in rows:
        times = (" / ".join(f"{value:.1f}" for value in row["times_ms"][n].values()) for n in TIMES)
        after = row["arrived_after_s"]
        cells = (
            row["computer"],
            f"{row['arrived']} of {row['drives']}",
            "-" if after is None else f"{after:.1f}",
            f"{100.0 * row['least_clearance_m']:.1f}",
            *times,
            str(row["controller_periods_skipped"]),
        )
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)
