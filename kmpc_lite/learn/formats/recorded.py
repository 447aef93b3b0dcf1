"""Drives that kmpc recorded itself: `kmpc simulate --record`, `kmpc run --record`."""

from __future__ import annotations

import json
from collections import Counter
from math import atan2, remainder, tau
from pathlib import Path
from typing import Any

from kmpc_lite.errors import DataError
from kmpc_lite.learn.formats.mcap import LARGEST_MESSAGE, Found, read_mcap
from kmpc_lite.learn.formats.streams import Thinned
from kmpc_lite.learn.logs import Log, ReadOptions, Series, Topic

POSES, COMMANDS, GATE = "/pose", "/command", "/gate"
DRIVING = ("ACTIVE", "STOPPING", "HOLDING")
"""States of the safety gate in which the robot obeys the commands that are recorded."""
BREAKS = 0.3
"""Where the robot did not obey, poses are left out, and so is this long after it [s]."""


def read_recorded(path: Path, options: ReadOptions) -> Log:
    """Read poses and commands of a recorded drive, as far as the robot obeyed them."""
    if options.topics:
        raise DataError(f"{path}: --topics: a drive that kmpc recorded has one pose, one command")
    taken = _Taken(options)
    try:
        for found in read_mcap(path):
            taken.take(found)
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise DataError(f"{path}: not a drive that kmpc recorded: {error!s:.200}") from error
    series = [_series(path, name, rows) for name, rows in taken.rows.items()]
    topics = tuple(Topic(name, "kmpc", count, None) for name, count in sorted(taken.counts.items()))
    notes = (f"poses: {series[0].source}; commands: {series[1].source}", *taken.notes())
    return Log(str(path), series[0], series[1], topics=topics, notes=notes)


class _Taken:
    """What is kept of a drive."""

    def __init__(self, options: ReadOptions) -> None:
        self.rows = {POSES: Thinned(3, options.spacing), COMMANDS: Thinned(2, options.spacing)}
        self.counts: Counter[str] = Counter()
        self._obeys, self._from = True, -1.0
        self._left_out = 0

    def take(self, found: Found) -> None:
        """Take in a message."""
        if found.topic.startswith("metadata:"):
            return
        self.counts[found.topic] += 1
        if found.topic not in (POSES, COMMANDS, GATE):
            return
        if len(found.content) > LARGEST_MESSAGE:
            raise ValueError(f"a message of {len(found.content):,} bytes on {found.topic}")
        time = found.time * 1e-9
        if found.topic != GATE and not self.rows[found.topic].wants(time):
            return
        told = json.loads(found.content)
        if found.topic == GATE:
            obeyed, self._obeys = self._obeys, told["state"] in DRIVING
            self._from = time if self._obeys and not obeyed else self._from
        elif found.topic == COMMANDS:
            self.rows[COMMANDS].add(time, _number(told["v"]), _number(told["omega"]))
        elif not self._obeys or time < self._from + BREAKS:
            self._left_out += 1
        else:
            place, turn = told["pose"]["position"], told["pose"]["orientation"]
            heading = remainder(2.0 * atan2(_number(turn["z"]), _number(turn["w"])), tau)
            self.rows[POSES].add(time, _number(place["x"]), _number(place["y"]), heading)

    def notes(self) -> tuple[str, ...]:
        """What a user should know."""
        if not self._left_out:
            return ()
        return (f"{self._left_out} poses of a robot that did not obey were left out",)


def _number(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"expected a number, got {value!r:.40}")
    return float(value)


def _series(path: Path, name: str, samples: Thinned) -> Series:
    rows = samples.rows()
    if len(rows) < 2:
        raise DataError(f"{path}: {name}: {len(rows)} message(s); expected at least 2")
    return Series(rows[:, 0], rows[:, 1:], f"{name} (kmpc)")
