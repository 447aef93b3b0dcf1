"""Reads a recorded drive, simulated or real: as a `Run` with all that lay behind its steps."""

from __future__ import annotations

import json
import math
import os
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from firmware_bridge.recording.drive.encoder import BEGIN, END, FORMAT, VERSION
from firmware_bridge.recording.drive.seen import ranges_of
from kmpc_lab.sim.closed_loop import Details, Outcome, Run
from kmpc_lite.control.plan import GoalProgress, PlanStatus
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.learn.formats.mcap import DRIVE, LARGEST_MESSAGE, Found, read_messages
from kmpc_lite.reading import open_regular, parse_toml
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.world import obstacle_gaps
from kmpc_lite.types import Array

LARGEST_FILE = 2**30  # a longer recording is for other tools [bytes]; it lasts for hours
STATUSES = frozenset(status.name for status in PlanStatus)
PROGRESSES = frozenset(progress.name for progress in GoalProgress)
ACTIVE = "ACTIVE"  # state of the safety gate in which commands pass: a real drive begins with it
SHORTEST = 1e-3  # shortest period of a drive [s]


def load_drive(path: str | os.PathLike[str]) -> Run:
    """Read a drive, simulated or real: a folder or an .mcap that ``--record`` wrote.

    Raises
    ------
    ScenarioError
        For a file that is missing, damaged, or no drive, in one line.
    """
    file = drive_file(Path(path))
    try:
        with open_regular(file, LARGEST_FILE) as opened:
            return drive_of(opened, str(file))
    except OSError as error:
        raise ScenarioError(f"{file}: cannot read the drive: {error.strerror or error}") from error


def drive_of(file: BinaryIO, name: str) -> Run:
    """Read a recorded drive from an open file; raises ScenarioError for anything else."""
    columns, texts = Columns(STATUSES, PROGRESSES), dict[str, dict[str, str]]()
    try:
        for found in read_messages(file):
            if found.topic.startswith("metadata:"):
                texts[found.topic.removeprefix("metadata:")] = found.content
            else:
                columns.take(found)
        return _Drive(name, columns, texts).run()
    except ScenarioError:
        raise
    except (ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        words = f"{type(error).__name__} {error}" if isinstance(error, KeyError) else str(error)
        raise ScenarioError(
            f"{name}: not a drive that kmpc recorded, or damaged: {words:.300}"
        ) from error


def drive_file(path: Path) -> Path:
    """Find the drive that is meant: a file, or the one in a folder.

    Raises ScenarioError for a folder without a drive.
    """
    if not path.is_dir():
        return path
    file = path / DRIVE
    if not file.exists():
        raise ScenarioError(f"{path}: a folder without a recorded drive: {DRIVE} is missing")
    return file


class _Drive:
    """Makes a run of what was collected."""

    def __init__(self, name: str, columns: Columns, texts: dict[str, dict[str, str]]) -> None:
        if BEGIN not in texts:
            raise ValueError("the drive is not described")
        told = texts[BEGIN]
        if (told["format"], told["version"]) != (FORMAT, VERSION):
            raise ValueError(
                f"expected {FORMAT} version {VERSION}, "
                f"got {told['format']} version {told['version']}"
            )
        drive = _object(told["drive"])
        self._scenario = Scenario.from_table(
            parse_toml(str(drive["scenario"])), str(drive["name"]), name
        )
        self._dt = number(drive["dt"])
        if not self._dt >= SHORTEST:
            raise ValueError(f"dt: expected at least {SHORTEST} s, got {self._dt:g}")
        self._info = _checked_info(drive["about"])
        self._outcome = _object(texts[END]["outcome"]) if END in texts else None
        self._columns = columns
        if not columns.steps:
            raise ValueError("no step of a controller in it")
        columns.steps.sort(key=lambda step: step[0])
        active = [time for time, state, _ in columns.gates if state == ACTIVE]
        self._start = min(active) if active else columns.steps[0][0]

    def run(self) -> Run:
        """Make the run."""
        details = self._details()
        span = float(details.times[-1]) + self._dt
        if self._outcome is not None and self._outcome["outcome"] == Outcome.REACHED.value:
            span = min(span, number(self._outcome["duration"]))
        count = min(max(round(span / self._dt), 1), 2 * len(details.times) + 100)
        grid = self._dt * np.arange(count)
        shown = np.maximum(np.searchsorted(details.times, grid + 0.5 * self._dt) - 1, 0)
        path = self._path(count, details)
        outcome, clearance = self._ended(details, path)
        states = path[:: (len(path) - 1) // count]
        return Run(
            scenario=self._scenario,
            dt=self._dt,
            outcome=Outcome(outcome["outcome"]),
            duration=number(outcome["duration"]),
            states=states,
            path=path,
            inputs=details.commands[shown],
            plans=details.plans[shown],
            statuses=tuple(details.statuses[k] for k in shown.tolist()),
            step_times=details.step_times[shown],
            clearance=clearance,
            info=self._info,
            details=details,
            errors=_errors(outcome.get("errors")),
        )

    def _ended(self, details: Details, path: Array) -> tuple[dict[str, Any], float]:
        """Outcome and smallest clearance; those of the recording where its end is missing."""
        told = self._outcome
        if told is not None:
            clearance = told["clearance"]
            if words := told.get("words"):
                self._info["ended"] = str(words)[:200]
            return told, np.inf if clearance is None else number(clearance)
        self._info["ended"] = "the recording breaks off"
        times = np.linspace(0.0, float(details.times[-1]), len(path))
        gaps = obstacle_gaps(self._scenario, path, times)
        duration = float(details.times[-1]) + self._dt
        return {"outcome": "timeout", "duration": duration}, float(gaps.min())

    def _path(self, count: int, details: Details) -> Array:
        """Poses (count S + 1, 3): true ones where they were recorded, else measured ones."""
        truth = self._seconds(self._columns.truth, 4)
        if len(truth) > count and (len(truth) - 1) % count == 0:
            return truth[:, 1:]
        poses = details.measured
        if len(poses) < 2:
            poses = np.column_stack([details.times, details.poses])
        times = self._dt * np.arange(4 * count + 1) / 4
        headings = np.unwrap(poses[:, 3])
        found = [np.interp(times, poses[:, 0], part) for part in (*poses[:, 1:3].T, headings)]
        return np.column_stack(found)

    def _details(self) -> Details:
        columns, steps = self._columns, self._columns.steps
        missing = [time for time, _ in steps if time not in columns.plans]
        if missing:
            steps = [step for step in steps if step[0] in columns.plans]
        if not steps:
            raise ValueError("no plan of a controller in it")
        plans = _even([columns.plans[time] for time, _ in steps])
        margins = _even([told["margins"][: plans.shape[1]] for _, told in steps], plans.shape[1])
        stamps = np.array([time for time, _ in steps])
        part = {name: np.array([told[name] for _, told in steps]) for name in steps[0][1]}
        return Details(
            times=(stamps - self._start) * 1e-9,
            poses=part["pose"],
            plans=plans,
            stage_time=float(part["stage_time"][0]),
            margins=margins,
            commands=part["command"],
            statuses=tuple(part["status"].tolist()),
            progress=tuple(part["progress"].tolist()),
            reasons=tuple(part["reason"].tolist()),
            clearances=part["clearance"],
            pose_ages=part["pose_age"],
            step_times=part["step_time"],
            paths=tuple(path for _, path in columns.paths),
            path_of=_numbered(stamps, columns.paths),
            circles=tuple(rows for _, rows in columns.circles),
            circles_of=_numbered(stamps, columns.circles),
            measured=self._seconds(columns.measured, 4),
            sent=self._seconds(columns.sent, 3),
            gates=tuple((self._second(t), state, why) for t, state, why in columns.gates),
            health=tuple((self._second(t), told) for t, told in columns.health),
            notes=tuple((self._second(t), text, bad) for t, text, bad in columns.notes),
            scans=tuple((self._second(t), scan) for t, scan in columns.scans),
        )

    def _second(self, time: int) -> float:
        return (time - self._start) * 1e-9

    def _seconds(self, rows: list[Any], width: int) -> Array:
        """Rows with their times in seconds, in order."""
        if not rows:
            return np.empty((0, width))
        table = np.array([(self._second(time), *rest) for time, *rest in rows])
        return table[np.argsort(table[:, 0], kind="stable")]


def _even(parts: list[Array], length: int | None = None) -> Array:
    """Arrays of different lengths as one; shorter ones hold their last row."""
    most = length or max(len(part) for part in parts)
    shape = (len(parts), most, *parts[0].shape[1:])
    out = np.zeros(shape, dtype=np.float32)
    for row, part in zip(out, parts, strict=True):
        row[: len(part)] = part
        if len(part):
            row[len(part) :] = part[-1]
    return out


def _numbered(stamps: Array, rows: list[tuple[int, Array]]) -> Array:
    """Number (T,) of the newest row at each stamp; -1 before the first."""
    times = np.array([time for time, _ in rows], dtype=np.int64)
    found: Array = np.searchsorted(times, stamps, side="right") - 1
    return found


def _errors(told: Any) -> tuple[float, float] | None:
    """Errors that a drive reported: two numbers, or None."""
    if told is None:
        return None
    distance, turn = told
    return number(distance), number(turn)


def _object(text: str) -> dict[str, Any]:
    found = json.loads(text)
    if not isinstance(found, dict):
        raise ValueError("expected an object")
    return found


def _checked_info(info: Any) -> dict[str, Any]:
    if not isinstance(info, dict):
        raise ValueError("about: expected an object")
    return info


MOST_STEPS = 500_000  # a drive of 14 hours at 10 steps a second
MOST_OTHERS = 4_000_000  # messages of all other kinds together
FARTHEST = 1e6  # largest number of a drive [m, rad, m/s, rad/s, s]
MOST_STAGES, MOST_POINTS, MOST_BEAMS = 1000, 10_000, 100_000


class Columns:
    """What came of each kind, in its order; times are nanoseconds until requested.

    `statuses`, `progresses`: words that a step may have.
    """

    def __init__(self, statuses: frozenset[str], progresses: frozenset[str]) -> None:
        self._statuses, self._progresses = statuses, progresses
        self.steps: list[tuple[int, dict[str, Any]]] = []
        self.plans: dict[int, Array] = {}
        self.paths: list[tuple[int, Array]] = []
        self.circles: list[tuple[int, Array]] = []
        self.scans: list[tuple[int, LaserScan]] = []
        self.measured: list[tuple[int, float, float, float]] = []
        self.truth: list[tuple[int, float, float, float]] = []
        self.sent: list[tuple[int, float, float]] = []
        self.gates: list[tuple[int, str, tuple[str, ...]]] = []
        self.health: list[tuple[int, Mapping[str, Any]]] = []
        self.notes: list[tuple[int, str, bool]] = []
        self._others = 0
        self._sight: float | None = None
        """How far beams of the next scan see that meet nothing [m]; its step comes before it."""
        self._take: dict[str, Callable[[int, dict[str, Any]], None]] = {
            "/step": self._step,
            "/plan": lambda t, m: self.plans.__setitem__(t, _poses(m, MOST_STAGES)),
            "/path": lambda t, m: self.paths.append((t, _poses(m, MOST_POINTS)[:, :2])),
            "/obstacles": lambda t, m: self.circles.append((t, _rows(m["circles"], 5))),
            "/scan": lambda t, m: self.scans.append((t, _scan(m, self._sight))),
            "/pose": lambda t, m: self.measured.append((t, *_pose(m["pose"]))),
            "/truth": lambda t, m: self.truth.append((t, *_pose(m["pose"]))),
            "/command": lambda t, m: self.sent.append((t, number(m["v"]), number(m["omega"]))),
            "/gate": lambda t, m: self.gates.append((t, _word(m["state"]), _words(m["reasons"]))),
            "/health": lambda t, m: self.health.append((t, m)),
            "/log": lambda t, m: self.notes.append((t, _word(m["message"]), m["level"] > 2)),
        }

    def take(self, found: Found) -> None:
        """Take in a message; unneeded ones are ignored.

        Raises ValueError, KeyError, TypeError for a message that is not as ours are.
        """
        take = self._take.get(found.topic)
        if take is None:
            return
        if len(found.content) > LARGEST_MESSAGE:
            raise ValueError(f"a message of {len(found.content):,} bytes on {found.topic}")
        if found.topic != "/step":
            self._others += 1
        if self._others > MOST_OTHERS or len(self.steps) > MOST_STEPS:
            raise ValueError(f"more than {MOST_STEPS:,} steps, or {MOST_OTHERS:,} other messages")
        content = json.loads(found.content)
        if not isinstance(content, dict):
            raise ValueError(f"{found.topic}: expected an object")
        take(found.time, content)

    def _step(self, time: int, told: dict[str, Any]) -> None:
        if told["status"] not in self._statuses or told["progress"] not in self._progresses:
            raise ValueError("a step of unknown status")
        clearance, age = told["clearance"], told["pose_age"]
        sight = told.get("sight")  # drives of older versions do not tell
        self._sight = None if sight is None else number(sight)
        kept = {
            "pose": _numbers(told["pose"], 3),
            "status": str(told["status"]),
            "progress": str(told["progress"]),
            "reason": _word(told["reason"]),
            "command": _numbers(told["command"], None)[[0, -1]],
            "clearance": math.inf if clearance is None else number(clearance),
            "pose_age": math.nan if age is None else number(age),
            "step_time": number(told["step_time"]),
            "stage_time": number(told["stage_time"]),
            "margins": _numbers(told["margins"], None),
        }
        self.steps.append((time, kept))


def number(value: Any) -> float:
    """Read a number that a drive can have."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a number, got {value!r:.40}")
    if not abs(value) <= FARTHEST:
        raise ValueError(f"expected a number of at most {FARTHEST:g}, got {value!r:.40}")
    return float(value)


def _numbers(values: Any, count: int | None) -> Array:
    if not isinstance(values, list) or len(values) > MOST_STAGES:
        raise ValueError(f"expected a list of numbers, got {values!r:.40}")
    found = np.array([number(value) for value in values], dtype=float)
    if count is not None and len(found) != count:
        raise ValueError(f"expected {count} numbers, got {len(found)}")
    return found


def _rows(rows: Any, width: int) -> Array:
    if not isinstance(rows, list) or len(rows) > MOST_POINTS:
        raise ValueError("expected a list of rows")
    return np.array([_numbers(row, width) for row in rows]).reshape(-1, width)


def _pose(told: Any) -> tuple[float, float, float]:
    place, turn = told["position"], told["orientation"]
    heading = 2.0 * math.atan2(number(turn["z"]), number(turn["w"]))
    return number(place["x"]), number(place["y"]), math.remainder(heading, math.tau)


def _poses(told: dict[str, Any], most: int) -> Array:
    poses = told["poses"]
    if not isinstance(poses, list) or len(poses) > most:
        raise ValueError(f"expected a list of at most {most} poses")
    return np.array([_pose(pose) for pose in poses], dtype=np.float32).reshape(-1, 3)


def _scan(told: dict[str, Any], reach: float | None) -> LaserScan:
    """Give what a scan saw whose beams see so far [m]."""
    ranges = told["ranges"]
    if not isinstance(ranges, list) or not 1 <= len(ranges) <= MOST_BEAMS:
        raise ValueError("expected a list of ranges")
    lengths = ranges_of(np.array([number(r) for r in ranges]))
    first, last = number(told["start_angle"]), number(told["end_angle"])
    step = (last - first) / max(len(lengths) - 1, 1)
    farthest = 1.0 + float(lengths[np.isfinite(lengths)].max(initial=0.0))
    return LaserScan(lengths, first, step, reach or farthest, mount=_pose(told["pose"]))


def _word(word: Any) -> str:
    if not isinstance(word, str) or len(word) > 2000:
        raise ValueError(f"expected a text, got {word!r:.40}")
    return word


def _words(words: Any) -> tuple[str, ...]:
    if not isinstance(words, list) or len(words) > 100:
        raise ValueError("expected a list of texts")
    return tuple(map(_word, words))
