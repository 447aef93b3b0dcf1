"""What online adaptation remembers from step to step: data that copies and pickles.

24 numbers are kept of a step, and 16 sums over steps: with the weight a of positions p.p, p.d, p x
d, d.d; with the weight b of turns h h, h g, g g, h turned, g turned, turned turned; how many steps
had a weight a, and b; and with the weight a p.s, p x s, s.s, s.d. `sums_of` makes them in
this order, `estimate` reads them.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import Array

MOTION_SIZE = 9
"""Numbers of a motion: the displacement p = (px, py) that the model gives [m], in the map's frame,
and the measured one d = (dx, dy); the turn h that the model gives [rad], the way ahead g [m], and
the measured turn; and the part s = (sx, sy) of p that an omni's wheels drive sideways, else 0."""
MOTION = slice(0, MOTION_SIZE)
"""The motion, whitened: what the noise of a pose shares with the steps before is taken back."""
WEIGHTS = slice(MOTION_SIZE, MOTION_SIZE + 2)
"""The weights a of the position and b of the turn."""
HEADING = slice(WEIGHTS.stop, WEIGHTS.stop + 2)
"""cos and sin of the heading before the step."""
SPEEDS = slice(HEADING.stop, HEADING.stop + 2)
"""v^2 and omega^2 of the command."""
AS_MEASURED = slice(SPEEDS.stop, SPEEDS.stop + MOTION_SIZE)
"""The motion once more, as it was measured."""
STEP_SIZE = AS_MEASURED.stop
"""Numbers that are kept of a step."""
SUMS = 16
"""Sums over steps."""
NO_STEPS = (0.0,) * MOTION_SIZE
"""Fading sums where the steps before are unknown."""


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
    """Steps that entered the sums."""
    still: int = 0
    """Steps left out since the robot hardly moved."""
    rejected: int = 0
    """Steps left out as broken measurements."""
    models: int = 0
    """Corrected models given."""


@dataclass
class AdaptationState:
    """Sums over steps, and what has been made of them."""

    recent: Array
    """(window, SUMS) sums of the newest steps, a ring; see above."""
    raw: Array
    """(memory, STEP_SIZE) the newest steps themselves, a ring; see above."""
    position_noise: list[float]
    """Variance of a step's position by 1, v^2, omega^2 that steps are weighed by."""
    heading_noise: list[float]
    """The same of its turn."""
    slow: Array = field(default_factory=lambda: np.zeros(SUMS))
    """(SUMS,) sums with exponential forgetting."""
    slow_count: float = 0.0
    """How many steps are in them."""
    next_model: int = 0
    """Count at which the model is given again after a change; 0: not any more."""
    count: int = 0
    """Steps taken in since the last change that was no floor."""
    since: int = 0
    """Steps since the change."""
    usual: tuple[float, float] = (0.0, 0.0)
    """Fading mean of the variance of position and of turns."""
    earlier: tuple[float, ...] = NO_STEPS
    """Fading sum of the steps before, which whitens the next one."""
    after: tuple[float, ...] = ()
    """Pose at which the step before ended: one that begins elsewhere shares no noise with it."""
    gains: Gains = Gains()
    """The gains in use."""
    errors: tuple[float, float] = (0.0, 0.0)
    """Fading squared errors of the learned model and of the adapted one."""
    judged: int = 0
    """Steps in them."""
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
        self.recent = np.zeros_like(self.recent)
        self.raw = np.zeros_like(self.raw)
        self.slow = np.zeros(SUMS)
        self.slow_count, self.next_model = 0.0, 0
        self.count, self.since = 0, 0
        self.usual = (0.0, 0.0)
        self.earlier = NO_STEPS
        self.errors, self.judged = (0.0, 0.0), 0

    def kept(self, count: int) -> Array:
        """Indices of the newest steps in the ring of steps, newest first."""
        kept: Array = (self.count - 1 - np.arange(count)) % len(self.raw)
        return kept

    def weigh_by(self, coefficients: Array) -> None:
        """Weigh coming steps by a covariance (3, 3, 3), as `NoiseModel` has it."""
        self.position_noise = [float(c[0, 0] + c[1, 1]) / 2 for c in coefficients]
        self.heading_noise = [float(c[2, 2]) for c in coefficients]
