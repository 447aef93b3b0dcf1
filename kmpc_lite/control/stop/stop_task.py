"""What a stop trajectory is, what it starts from, and what comes of looking for one: plain data."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from kmpc_lite.control.kernels.clearance import COLUMNS, SPREAD_RATE, VELOCITY
from kmpc_lite.control.margins.command_check import CommandCheck
from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.stop.braking import Braking
from kmpc_lite.control.world.half_planes import NO_SOLIDS_AHEAD, SolidsAhead
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.nearby import Nearby


class StopTrajectory(NamedTuple):
    """What follows the coming command."""

    further: int = 0
    """Commands of the plan after the coming one."""
    at_once: bool = False
    """Whether the brake is zero at once, not the ramp."""

    def commands(self, inputs: Array, braking: Braking) -> Array:
        """Commands (T, 2) from the coming one to zero, of a plan's inputs (N, 2)."""
        driven = inputs[: 1 + self.further]
        brake = np.zeros((1, 2)) if self.at_once else braking.ramp(driven[-1])
        return np.concatenate([driven, brake])


@dataclass(frozen=True, eq=False, slots=True)
class StopTask:
    """What a stop trajectory starts from, and what it must be clear of."""

    model: MotionModel
    """Predicts."""
    past: Array
    """(L, 2) commands already sent, oldest first."""
    last: Array
    """(2,) the command sent last."""
    things: Array
    """(M, 7) what is round, as it is now: a table of `kernels.clearance`."""
    nearby: Nearby | None = None
    """Solids that the robot can come to."""
    solids_ahead: SolidsAhead = NO_SOLIDS_AHEAD
    """These solids from a point near the robot."""
    check: CommandCheck | None = None
    """Margins of single commands; without them every plan is accepted."""
    drift: DriftState | None = None
    """Of the drift detector; given with `check`."""
    perhaps: Array = field(default_factory=lambda: np.empty((0, COLUMNS)))
    """(P, 7) what may be walking, and is else known as something that stands."""

    @property
    def walking(self) -> tuple[Array, Array]:
        """All things (M + P, 7), and speeds at which they can be walking at the most (M + P,)."""
        everything = np.concatenate([self.things, self.perhaps])
        speeds = np.hypot(*everything[:, VELOCITY].T) + everything[:, SPREAD_RATE]
        return everything, speeds


class CheckedPlan(NamedTuple):
    """A plan after it was checked for a stop."""

    stop: StopTrajectory | None
    """None where the robot could not stop clear: the plan must not be driven."""
    states: Array
    """(N + 1, 3), rolled out anew where the plan was slowed."""
    inputs: Array
    """(N, 2), whose first is the coming command."""
    slowed: bool = False
    """Whether the coming command was slowed."""
