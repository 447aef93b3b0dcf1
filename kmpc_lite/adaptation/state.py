"""What online adaptation remembers from step to step: data that copies and pickles."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from kmpc_lite.types import Array

LATER = 0.1, 0.2, 0.4
"""How much later than its model knows a robot may answer [s in its units]: what earlier commands
explain is no gain."""
STEP = np.dtype(
    [
        ("terms", float, (2, 4 + len(LATER), 2)),
        ("measured", float, (2, 4, 2)),
        ("tells", float, 2),
        ("heading", float, 2),
        ("speeds", float, 2),
    ]
)
"""What is kept of a step.

`terms`: of the displacement in the map's frame [m, m], and of the turn [rad, 0]: its gains' terms
(ahead, left, aside; turn, pull, none), what was measured, and by how much more the commands earlier
by `LATER` would have driven; whitened: what the noise of a pose shares with the steps before is
taken back. `measured`: the first four as they were. `tells`: 1 where it tells of moving, and of
turning. `heading`: its cos and sin, before the step. `speeds`: v^2 and omega^2 of the command."""


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
    """Steps that gains are estimated from, and others; corrected models that were given."""

    used: int = 0
    still: int = 0
    """Left out since the robot hardly moved."""
    rejected: int = 0
    """Left out as broken measurements."""
    models: int = 0


@dataclass
class AdaptationState:
    """The newest steps, and what has been made of them."""

    steps: Array
    """(memory,) of `STEP`, a ring."""
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
    carried: Array | float = 0.0
    """Fading sum of the terms before, which whitens the next ones."""
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
        self.carried, self.given = 0.0, []

    def newest(self, most: int) -> Array:
        """Return the newest steps since the change, the newest first."""
        memory = len(self.steps)
        kept = (self.count - 1 - np.arange(min(most, self.since, memory))) % memory
        out: Array = self.steps[kept]
        return out
