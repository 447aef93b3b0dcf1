"""A run as the instants that a page plays: what was known, planned and kept at each of them.

And what happened, in lines: where a step was not solved, the path or the gate changed.
"""

from __future__ import annotations

import re
from base64 import b64encode
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from html import escape
from typing import NamedTuple

import numpy as np

from kmpc_lab.sim.closed_loop import Details, Outcome, Run
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.errors import KmpcError
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

MOST = 200  # lines of a page; a longer drive has more
APART = 0.5  # the same words are said again after this time [s]
PROGRESS_WORDS = {
    "DRIVING": "drives",
    "HOLDING": "holds its goal",
    "UNREACHABLE": "finds no path to its goal",
    "WAITING": "waits",
}


class Event(NamedTuple):
    """Something that happened."""

    time: float  # [s]
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

    details: Details  # what was recorded; of a run without a recording what can be worked out
    poses: Array  # (T, 3) where the robot was
    gaps: Array  # (T,) clearance to what the scenario holds [m]; infinite without obstacles
    distance: Array  # (T,) to the goal [m]
    turn: Array  # (T,) heading error to the goal [rad]
    sent: Array  # (T, 2) command that was on its way to the robot; NaN if none was
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


STATUS_WORDS = {
    PlanStatus.SOLVED.name: "solved",
    PlanStatus.FEASIBLE.name: "solver stopped early, plan verified",
    PlanStatus.FALLBACK.name: "rest of the last good plan",
    PlanStatus.STOPPED.name: "no usable plan, braking",
}
ALT = "Map of the drive: obstacles, the robot's path, start and goal; below it commands over time"
CAPTION = (
    "To scale. Below, what was sent to the motors, one step per period; shaded: steps whose plan "
    "was not simply solved. Clearance is from edge to edge."
)
UNIT = re.compile(r"(?<=\d) (?=(?:mm|ms|mrad|m|s|rad|m/s|rad/s|%)(?![\w]))")


def length(metres: float) -> str:
    """Length in mm below a metre, else in m.

    >>> length(0.0519), length(-0.004), length(2.0768)
    ('52 mm', '-4 mm', '2.08 m')
    """
    return (
        f"{1e3 * metres:.{0 if abs(metres) >= 0.01 else 1}f} mm".replace(".0 ", " ")
        if abs(metres) < 1.0
        else f"{metres:.2f} m"
    )


def milliseconds(seconds: float) -> str:
    """Time of a step with three digits.

    >>> milliseconds(0.00067634), milliseconds(0.0135922), milliseconds(0.1)
    ('0.676 ms', '13.6 ms', '100 ms')
    """
    value = 1e3 * seconds
    return f"{value:.{0 if value >= 100 else 1 if value >= 10 else 2 if value >= 1 else 3}f} ms"


def angle(radians: float) -> str:
    """Angle in rad and degrees.

    >>> angle(0.1351)
    '0.135 rad (7.7°)'
    """
    return f"{radians:.3f} rad ({np.degrees(radians):.1f}°)"


def outcome_title(run: Run) -> str:
    """Outcome and time in a few words."""
    if run.outcome is Outcome.REACHED:
        return f"Goal reached in {run.duration:.4g} s"
    if run.outcome is Outcome.COLLISION:
        return f"Collision after {run.duration:.4g} s"
    return f"Goal not reached within {run.duration:.4g} s"


def clearance_words(run: Run) -> str:
    """Smallest distance to an obstacle, in a few words."""
    if not np.isfinite(run.clearance):
        return "no obstacles"
    if run.clearance < 0.0:
        return f"{length(-run.clearance)} deep into an obstacle"
    return f"{length(run.clearance)} clear of obstacles"


def outcome_sentence(run: Run) -> str:
    """Outcome in one sentence, for a reader that has not seen a run before."""
    scenario = run.scenario
    if run.outcome is Outcome.COLLISION:
        where = f"{length(run.position_error)} from the goal"
        return (
            f"The robot touched an obstacle {run.duration:.4g} s after its start, {where}, "
            f"and went {length(-run.clearance)} into it."
        )
    count = scenario.obstacle_count
    past = f" It kept at least {length(run.clearance)} from {_obstacles(count)}." if count else ""
    short = f"{length(run.position_error)} and {angle(run.heading_error)}"
    if run.outcome is Outcome.REACHED:
        return (
            f"The robot reached its goal in {run.duration:.4g} s and stands {short} from it.{past}"
        )
    ended = f" How it ended: {run.info['ended']}." if run.info.get("ended") else ""
    return (
        f"The robot did not reach its goal within {run.duration:.4g} s: "
        f"it is still {short} from it.{past}{ended}"
    )


def _obstacles(count: int) -> str:
    return "the obstacle" if count == 1 else f"all {count} obstacles"


def substeps(run: Run) -> int:
    """Sub-samples per period in `Run.path`.

    Raises KmpcError for a run without a single step, whose arrays do not fit together, or that ran
    away to infinity.
    """
    steps = len(run.inputs)
    if steps == 0 or (len(run.path) - 1) % steps or len(run.path) <= steps:
        raise KmpcError(
            "run: expected at least one step and whole sub-samples, "
            f"got {steps} steps and a path of {len(run.path)} poses"
        )
    if not (np.isfinite(run.path).all() and np.isfinite(run.inputs).all()):
        raise KmpcError(
            "run: the path or the commands hold NaN or infinity; "
            "there is nothing that could be drawn to scale"
        )
    return (len(run.path) - 1) // steps


def path_times(run: Run) -> Array:
    """Times (T S + 1,) of the poses in `Run.path` [s]."""
    times: Array = np.arange(len(run.path)) * (run.dt / substeps(run))
    return times


def path_clearances(run: Run) -> Array:
    """Clearance (T S + 1,) between robot and nearest obstacle along the path [m].

    It is infinite without obstacles.
    """
    return obstacle_gaps(run.scenario, run.path, path_times(run))


def image(svg: bytes) -> str:
    """The picture as an element."""
    source = f"data:image/svg+xml;base64,{b64encode(svg).decode('ascii')}"
    below = f"<figcaption>{escape(CAPTION)}</figcaption>"
    return f'<figure class="map"><img alt="{escape(ALT)}" src="{source}">{below}</figure>'


def joined(words: str) -> str:
    """Keep a number and its unit on one line."""
    return UNIT.sub("\u00a0", words)


def text(words: str) -> str:
    """Escape, and keep a number and its unit on one line."""
    return escape(joined(words))


def table(rows: Iterable[tuple[str, str]]) -> str:
    """Rows of a name and a value; both are text, not HTML."""
    body = "\n".join(
        f'<tr><th scope="row">{text(name)}</th><td>{text(value)}</td></tr>' for name, value in rows
    )
    return f'<div class="scroll"><table>\n{body}\n</table></div>'
