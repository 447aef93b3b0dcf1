"""What lay behind each step of a drive, as far as it was recorded."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.errors import ScenarioError
from kmpc_lite.types import Array

STEPS = ("times", "poses", "plans", "margins", "commands", "clearances", "pose_ages", "step_times")
NUMBERS, WORDS = ("path_of", "circles_of"), ("statuses", "progress", "reasons")
"""Fields that have an entry for each step."""


@dataclass(frozen=True, eq=False)
class Details:
    """T steps, at the times at which they were really made.

    Times count from the moment in which the first command passed.
    """

    times: Array
    """(T,) when each step was made, since the first command passed [s]."""
    poses: Array
    """(T, 3) pose that each step planned from."""
    plans: Array
    """(T, S, 3) states of the plans, `stage_time` apart."""
    stage_time: float
    """Time between the stages of a plan [s]."""
    margins: Array
    """(T, S) margins that the plans keep at these stages [m]."""
    commands: Array
    """(T, 2) commands that the plans begin with."""
    statuses: tuple[str, ...]
    progress: tuple[str, ...]
    reasons: tuple[str, ...]
    clearances: Array
    """(T,) clearance of the plans [m]; infinite without obstacles."""
    pose_ages: Array
    """(T,) age of each step's pose [s]; NaN if it is not known."""
    step_times: Array
    """(T,) time that each step took [s]."""
    paths: tuple[Array, ...]
    """Paths (K, 2) that guidance followed [m]."""
    path_of: Array
    """(T,) number of each step's path; -1: none."""
    circles: tuple[Array, ...]
    """Circles (M, 5) that were seen."""
    circles_of: Array
    """(T,) number of those that each step saw; -1: none."""
    measured: Array
    """(P, 4) poses as they came: time [s], x, y [m], theta [rad]."""
    sent: Array
    """(C, 3) commands that went to the robot: time [s], v [m/s], omega [rad/s]."""
    gates: tuple[tuple[float, str, tuple[str, ...]], ...] = ()
    """Times [s], states of the safety gate, and the reasons for them."""
    health: tuple[tuple[float, Mapping[str, Any]], ...] = ()
    """Times [s], and the state of link and vehicle."""
    notes: tuple[tuple[float, str, bool], ...] = ()
    """Times [s], what was reported, and whether it is bad."""
    scans: tuple[tuple[float, LaserScan], ...] = ()
    """Times [s], and what was seen."""

    def between(self, begin: float, end: float) -> Details:
        """Give the steps from one time to another [s].

        Raises ScenarioError if there are none.
        """
        chosen = np.flatnonzero((self.times >= begin - 1e-6) & (self.times <= end + 1e-6))
        if not len(chosen):
            raise ScenarioError(
                f"no step from {begin:g} s to {end:g} s: "
                f"the drive lasts from {self.times[0]:.2f} s to {self.times[-1]:.2f} s"
            )
        arrays: dict[str, Any] = {name: getattr(self, name)[chosen] for name in (*STEPS, *NUMBERS)}
        words: dict[str, Any] = {
            name: tuple(getattr(self, name)[k] for k in chosen) for name in WORDS
        }
        gates = tuple(gate for gate in self.gates if gate[0] <= end)
        return replace(self, **arrays, **words, gates=gates)
