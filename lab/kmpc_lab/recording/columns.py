"""Collects the messages of a recorded drive, kind by kind, without trusting them."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from firmware_bridge.recording.drive.seen import ranges_of
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.learn.formats.mcap import LARGEST_MESSAGE, Found
from kmpc_lite.types import Array

MOST_STEPS = 500_000
"""A drive of 14 hours at 10 steps a second."""
MOST_OTHERS = 4_000_000
"""Messages of all other kinds together."""
FARTHEST = 1e6
"""Largest number of a drive [m, rad, m/s, rad/s, s]."""
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
