"""What a call of the SQP remembers, answers, and keeps track of meanwhile: plain data."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from kmpc_lite.control.nmpc.line_search import Penalties
from kmpc_lite.control.nmpc.qp_solvers import QPStatus
from kmpc_lite.control.nmpc.trajectory import Trajectory
from kmpc_lite.types import Array


@dataclass(slots=True)
class SQPState:
    """What outlives a call; it matters where there is a deadline only."""

    search_time: float = 0.0
    """How long line searches have taken lately at the most [s]: left free after a QP."""


@dataclass(frozen=True, eq=False, slots=True)
class SQPResult:
    """Where the passes ended."""

    trajectory: Trajectory
    status: QPStatus
    """Of the last QP."""
    passes: int
    step: float
    """Largest change of the last pass [m, rad, m/s, rad/s]; infinite where only one was asked
    for."""
    defect: float
    """How far the model contradicts the trajectory over one period [m, rad]."""
    next_state: Array
    """(3,) what the model expects after the first command."""
    timing: dict[str, float] = field(default_factory=dict)
    """Seconds by phase."""
    reason: str = ""
    """Why the passes ended early, or the QP failed; empty where all is well."""


@dataclass(slots=True, eq=False)
class Progress:
    """How far a call has come."""

    guess: Trajectory
    limit: int
    tolerance: float
    shortest: float
    penalties: Penalties
    origin: Array
    """(3,) around which the QP is solved."""
    next_state: Array
    margins: Array | float = 0.0
    passes: int = 0
    length: float = 0.0
    step: float = math.inf
    defect: float = math.inf
    pressed_depth: float = math.inf
    """How deep the plan stood in an obstacle when the slack penalty grew last [m]."""
    status: QPStatus = QPStatus.FAILED
    reason: str = ""
    longest_pass: float = 0.0
    timing: dict[str, float] = field(
        default_factory=lambda: dict.fromkeys(("linearise", "fill", "solve", "search"), 0.0)
    )
