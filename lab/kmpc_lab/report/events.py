"""What happened in a drive, in lines: where a step was not solved, the path or the gate changed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from kmpc_lab.report.words import STATUS_WORDS
from kmpc_lab.sim.details import Details

MOST = 200
"""Lines of a page; a longer drive has more."""
APART = 0.5
"""The same words are said again after this time [s]."""
PROGRESS_WORDS = {
    "DRIVING": "drives",
    "HOLDING": "holds its goal",
    "UNREACHABLE": "finds no path to its goal",
    "WAITING": "waits",
}


class Event(NamedTuple):
    """Something that happened."""

    time: float
    """[s]"""
    words: str
    bad: bool = False


def events_of(details: Details) -> list[Event]:
    """Give what happened, in order, without what is said over and over."""
    found = sorted([*_steps(details), *_gates(details)], key=lambda event: event.time)
    said: dict[str, float] = {}
    events: list[Event] = []
    for event in found:
        before, said[event.words] = said.get(event.words), event.time
        if before is None or event.time - before >= APART:
            events.append(event)
    return events


def _steps(details: Details) -> Iterator[Event]:
    """Changes from one step to the next."""
    before = ("SOLVED", "DRIVING", -1)
    for k, time in enumerate(details.times.tolist()):
        status, progress = details.statuses[k], details.progress[k]
        path, reason = int(details.path_of[k]), details.reasons[k]
        why = f": {reason}" if reason else ""
        if status != before[0]:
            yield Event(time, f"{STATUS_WORDS.get(status, status)}{why}", status != "SOLVED")
        if progress and progress != before[1]:
            words = PROGRESS_WORDS.get(progress, progress)
            bad = progress in ("UNREACHABLE", "WAITING")
            yield Event(time, f"the robot {words}{why}", bad)
        if path != before[2] and path >= 0:
            yield Event(time, "sets out on its path" if before[2] < 0 else "takes another path")
        before = status, progress or before[1], path


def _gates(details: Details) -> Iterator[Event]:
    """Changes of the safety gate."""
    for time, state, reasons in details.gates:
        why = f": {', '.join(reasons)}" if reasons else ""
        yield Event(time, f"safety gate {state.lower()}{why}", bool(reasons) or state == "ESTOP")
