"""What online adaptation remembers from step to step: data that copies and pickles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import Array

LATER = 0.1, 0.2, 0.4
"""How much later than its model knows a robot may answer [s in its units]: what earlier commands
explain is no gain."""
LATE = len(LATER)
WHITE = slice(0, 9 + 3 * LATE)
"""The motion in the map's frame: the displacement (px, py) that the model gives [m] and the
measured one (dx, dy), the turn h that the model gives [rad], the way ahead g [m], the measured
turn, and the part (sx, sy) of (px, py) that an omni's wheels drive sideways, else 0. Then by how
much more earlier commands would have driven it, x, y and turn of each. It is whitened: what the
noise of a pose shares with the steps before is taken back."""
MEASURED = slice(WHITE.stop, WHITE.stop + 9)
"""The motion as it was measured."""
NO_STEPS = (0.0,) * WHITE.stop
"""Fading sum of no steps."""
TELLS = slice(MEASURED.stop, MEASURED.stop + 2)
"""1 where the step tells of moving, and of turning, else 0."""
HEADING = slice(TELLS.stop, TELLS.stop + 2)
"""cos and sin of the heading before the step."""
SPEEDS = slice(HEADING.stop, HEADING.stop + 2)
"""v^2 and omega^2 of the command."""
STEP_SIZE = SPEEDS.stop
"""Numbers that are kept of a step."""


class Gains(NamedTuple):
    """Correction of a learned model: of velocities, of the turn rate, and turn per metre."""

    ahead: float = 1.0
    """Factor of the learned velocity."""
    left: float = 0.0
    """Drift to the left, as a share of the learned velocity."""
    turn: float = 1.0
    """Factor of the learned turn rate."""
    pull: float = 0.0
    """Turn to the left per metre driven [rad/m]."""
    aside: float = 1.0
    """Factor of the learned speed sideways of an omni; that of other wheels is `ahead`."""


@dataclass
class AdaptationCounts:
    """How many steps were used, left out and rejected."""

    used: int = 0
    """Steps that gains are estimated from."""
    still: int = 0
    """Steps left out since the robot hardly moved."""
    rejected: int = 0
    """Steps left out as broken measurements."""
    models: int = 0
    """Corrected models given."""


@dataclass
class AdaptationState:
    """The newest steps, and what has been made of them."""

    steps: Array
    """(memory, STEP_SIZE) the newest steps, a ring."""
    noise: Array
    """(3, 3, 3) covariance of a step's residuals by 1, v^2, omega^2, by which steps are weighed."""
    next_model: int = 0
    """Steps since the change at which the model is given again; 0: not any more."""
    count: int = 0
    """Steps taken in since the last change that was no floor."""
    since: int = 0
    """Steps since the change: gains are estimated from these."""
    judged: int = 0
    """Steps since gains were given."""
    carried: Array | tuple[float, ...] = NO_STEPS
    """Fading sum of the steps before, which whitens the next one."""
    given: list[tuple[float, float]] = field(default_factory=list)
    """Way ahead and turn that the model gave for the periods before, the newest first."""
    after: tuple[float, ...] = ()
    """Pose at which the step before ended: one that begins elsewhere shares no noise with it."""
    gains: Gains = Gains()
    """The gains in use."""
    refusals: int = 0
    """How many times in a row gains were found that no floor can cause."""
    wrong_model: str = ""
    """Why the model counts as another robot's; empty while it does not."""
    ended: str = ""
    """Why nothing is learned any more; empty while something is."""
    counts: AdaptationCounts = field(default_factory=AdaptationCounts)
    """What became of the steps."""

    def forget(self) -> None:
        """Forget the steps, not the gains."""
        self.next_model = self.count = self.since = self.judged = 0
        self.carried, self.given = NO_STEPS, []

    def add(self, step: Array) -> None:
        """Keep a step."""
        self.steps[self.count % len(self.steps)] = step
        self.count, self.since, self.judged = self.count + 1, self.since + 1, self.judged + 1
        self.counts.used += 1

    def newest(self, most: int) -> Array:
        """Return the newest steps since the change, (n, STEP_SIZE), the newest first."""
        memory = len(self.steps)
        kept = (self.count - 1 - np.arange(min(most, self.since, memory))) % memory
        out: Array = self.steps[kept]
        return out
