"""A run as the instants that a page plays: what was known, planned and kept at each of them.

And what happened, in lines: where a step was not solved, the path or the gate changed.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from kmpc_lab.report.words import STATUS_WORDS, substeps
from kmpc_lab.sim.closed_loop import Run
from kmpc_lab.sim.details import Details
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

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


@dataclass(frozen=True, eq=False)
class Moments:
    """T instants of a drive."""

    details: Details
    """What was recorded; of a run without a recording what can be worked out."""
    poses: Array
    """(T, 3) where the robot was."""
    gaps: Array
    """(T,) clearance to what the scenario holds [m]; infinite without obstacles."""
    distance: Array
    """(T,) to the goal [m]."""
    turn: Array
    """(T,) heading error to the goal [rad]."""
    sent: Array
    """(T, 2) command that was on its way to the robot; NaN if none was."""
    gate: Array
    """(T,) number of the gate's state in `Details.gates`; -1 before the first, or without."""


def moments(run: Run) -> Moments:
    """Give the instants of a run."""
    details = run.details or _worked_out(run)
    poses = _poses(run, details)
    goal = np.array(run.scenario.goal)
    return Moments(
        details,
        poses,
        obstacle_gaps(run.scenario, poses, np.maximum(details.times, 0.0)),
        distances(poses, goal),
        wrap(poses[:, 2] - goal[2]),
        _sent(details),
        _newest(details.times, np.array([time for time, *_ in details.gates])),
    )


def _worked_out(run: Run) -> Details:
    """Details of a run that was not recorded."""
    count = len(run.inputs)
    times = run.dt * np.arange(count)
    return Details(
        times=times,
        poses=run.states[:-1],
        plans=run.plans,
        stage_time=run.dt,
        margins=np.zeros((count, run.plans.shape[1])),
        commands=run.inputs[:, [0, -1]],
        statuses=run.statuses,
        progress=("",) * count,
        reasons=("",) * count,
        clearances=np.full(count, np.inf),
        pose_ages=np.full(count, np.nan),
        step_times=run.step_times,
        paths=(),
        path_of=np.full(count, -1),
        circles=tuple(run.scenario.circles_at(time) for time in times[: 1 + count * _moves(run)]),
        circles_of=np.arange(count) * _moves(run),
        measured=np.empty((0, 4)),
        sent=np.column_stack([times, run.inputs[:, [0, -1]]]),
        scans=run.scans,
    )


def _moves(run: Run) -> int:
    """1 where an obstacle moves, else 0."""
    return int(any(circle.vx or circle.vy for circle in run.scenario.circles))


def _poses(run: Run, details: Details) -> Array:
    """Where the robot was at each instant: measured ones of a real drive, else the true ones."""
    times, table = run.dt / substeps(run) * np.arange(len(run.path)), run.path
    if len(details.measured) > 1 and run.info.get("kind") == "driven":
        times, table = details.measured[:, 0], details.measured[:, 1:]
    headings = np.unwrap(table[:, 2])
    parts = (table[:, 0], table[:, 1], headings)
    return np.column_stack([np.interp(details.times, times, part) for part in parts])


def _sent(details: Details) -> Array:
    """Commands that each step led to: the last one before the next step."""
    found = np.full((len(details.times), 2), np.nan)
    if len(details.sent):
        ends = np.append(details.times[1:], np.inf)
        newest = np.searchsorted(details.sent[:, 0], ends - 1e-6) - 1
        # a command that is long gone was not on its way
        fresh = (newest >= 0) & (details.sent[newest, 0] > details.times - 1.0)
        found[fresh] = details.sent[newest[fresh], 1:]
    return found


def _newest(times: Array, changes: Array) -> Array:
    """Number (T,) of the newest change at each time; -1 before the first."""
    found: Array = np.searchsorted(changes, times + 1e-9, side="right") - 1
    return found
