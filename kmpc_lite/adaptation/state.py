"""What online adaptation remembers from step to step: data that copies and pickles."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from kmpc_lite.adaptation.columns import MOTION_SIZE, SUMS
from kmpc_lite.adaptation.gains import Gains
from kmpc_lite.types import Array

NO_STEPS = (0.0,) * MOTION_SIZE
"""Fading sums where the steps before are unknown."""


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
    """(window, SUMS) sums of the newest steps, a ring; see `columns`."""
    raw: Array
    """(memory, STEP_SIZE) the newest steps themselves, a ring; see `columns`."""
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
