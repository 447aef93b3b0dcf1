"""What one call of the SQP is asked: plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kmpc_lite.control.margins.drift_detector import DriftState
from kmpc_lite.control.margins.obstacle_margins import Tightening
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.nearby import Nearby


@dataclass(frozen=True, eq=False, slots=True)
class Task:
    """Model, reference, obstacles, margins and deadline of one call."""

    model: MotionModel
    """Predicts; its number of past commands is the QP's."""
    reference: Array
    """(N + 1, 3) states to steer for."""
    things: Array
    """(M, 7) what is round: a table of `kernels.clearance`."""
    past: Array
    """(L, 2) commands already sent, oldest first."""
    last: Array
    """(2,) the command sent last, zero of a robot that stands."""
    solids: Nearby | None = None
    """Polygons, walls and grids that the robot can come to."""
    tightening: Tightening | None = None
    """Margins beyond the radii; worked out at each linearisation and held during the pass."""
    drift: DriftState | None = None
    """Of the drift detector; given with `tightening`."""
    path_clearance: float | Array = math.inf
    """What the path keeps from obstacles beyond the problem's margin [m], or at each stage,
    (N, 1)."""
    terminal_share: float = 1.0
    """Part of the terminal weight that counts."""
    deadline: float = math.inf
    """When the answer must be there, on the clock of the SQP [s]."""
