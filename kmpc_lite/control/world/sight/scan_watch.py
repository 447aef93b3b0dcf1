"""Whether scanners still tell anything: one that has died tells nothing, one that hangs the same.

A range is noisy: a robot that has moved never sees the same scan again, to the last bit. What comes
again then is what was seen before, from where the robot is not any more; it is left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.control.options import SightOptions, unit_length
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.scan import LaserScan, Layout
from kmpc_lite.geometry import wrap
from kmpc_lite.types import Array

SAME_PLACE = 0.5
"""How far the robot may have come, or its edge may have turned, since a scan that is told again
[radii]; what is told again from farther away is what the scanner saw before."""
NOISY = 8
"""Fewest hits that never come again by chance: a few may, along a wall and told in centimetres."""
PERIODS = 2.5
"""Fewest periods that scans may stay away: one may be late."""
SCANNERS = 16
"""Most scanners that are remembered: one whose beams lie otherwise each time is new each time."""
Scanner = tuple[tuple[float, float, float], Layout]
"""Where it is mounted, and how its beams lie: it may tell each half of its turn by itself."""


@dataclass(frozen=True, eq=False, slots=True)
class LastScan:
    """What a scanner told last, and where the robot was when it told it first."""

    ranges: bytes
    """(B,) [m]."""
    pose: Array
    """(3,)."""


@dataclass(slots=True)
class ScanWatchState:
    """What scanners have told, and since when they tell nothing."""

    last: dict[Scanner, LastScan] = field(default_factory=dict)
    """The one that told something last at the end."""
    silent: float = 0.0
    """For how long nothing new was told [s]."""


class ScanWatch:
    """Leaves out scans that come again, and says when the robot is blind.

    `problem`: radius, in the robot's units. `options`: how far and how long. `period`: between two
    steps [s].
    """

    def __init__(self, problem: NavigationProblem, options: SightOptions, period: float) -> None:
        self._same, self._period = SAME_PLACE * unit_length(problem), period
        self._limit = max(options.blind_time, PERIODS * period)

    def see(
        self, state: ScanWatchState, scans: Sequence[LaserScan], pose: Array
    ) -> tuple[tuple[LaserScan, ...], str]:
        """Take in the scans of a step.

        `state`: updated. `scans`: without hits of the robot itself, which it carries along. None is
        a step without a scan. `pose`: (3,) of the robot, in its units. Returns `scans`: without
        those that came before, from elsewhere; `reason`: why the robot must not drive on; empty if
        it sees, or never had a scan.
        """
        if not scans and not state.last:
            return (), ""
        new = tuple(scan for scan in scans if self._is_new(state, scan, pose))
        if any(scan.hits.any() or scan.clear.any() for scan in new):
            state.silent = 0.0
            return new, ""
        state.silent += self._period
        if state.silent <= self._limit:
            return new, ""
        hangs = len(new) < len(scans)
        what = "have not changed while the robot moved" if hangs else "have told nothing"
        return new, f"scans {what} for {self._limit:g} s or longer: it does not drive blind"

    def _is_new(self, state: ScanWatchState, scan: LaserScan, pose: Array) -> bool:
        """Whether a scan is another one than the scanner's last, or the robot has hardly moved."""
        scanner, ranges = (scan.mount, scan.layout), scan.ranges.tobytes()
        before = state.last.pop(scanner, None)
        if before is None or before.ranges != ranges:
            state.last[scanner] = LastScan(ranges, pose.copy())
            if len(state.last) > SCANNERS:
                del state.last[next(iter(state.last))]
            return True
        state.last[scanner] = before
        if np.count_nonzero(scan.hits) < NOISY:
            return True
        x, y, turn = (pose - before.pose).tolist()
        near = x * x + y * y <= self._same**2
        return near and abs(float(wrap(turn))) <= SAME_PLACE
