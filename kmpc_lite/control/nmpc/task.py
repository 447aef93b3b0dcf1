"""What one call of the SQP is asked, and what it answers: plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

from kmpc_lite.control.margins.margins import Margins
from kmpc_lite.control.margins.model_noise import FeltNoise
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.solids import Nearby


class Task(NamedTuple):
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
    margins: Margins | None = None
    """Margins beyond the radii; worked out at each linearisation and held during the pass."""
    felt: FeltNoise | None = None
    """The noise, as past innovations inflate it; given with `margins`."""
    path_clearance: float | Array = math.inf
    """What the path keeps from obstacles beyond the problem's margin [m], or at each stage,
    (N, 1)."""
    curvature: float = 0.0
    """In which the wheels of a car stand now [1/m]."""
    terminal_share: float = 1.0
    """Part of the terminal weight that counts."""
    deadline: float = math.inf
    """When the answer must be there, on the clock of the SQP [s]."""


@dataclass(slots=True, eq=False)
class SQPResult:
    """How far the passes of a call have come, and where they ended."""

    trajectory: Trajectory
    """The iterate; the start before the first pass."""
    status: QPStatus = QPStatus.FAILED
    """Of the last QP."""
    passes: int = 0
    step: float = math.inf
    """Largest change of the last pass [m, rad, m/s, rad/s]."""
    defect: float = math.inf
    """How far the model contradicts the trajectory over one period [m, rad]."""
    timing: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("linearise", "fill", "solve"), 0.0)
    )
    """Seconds by phase."""
    reason: str = ""
    """Why the passes ended early, or the QP failed; empty if all is well."""
