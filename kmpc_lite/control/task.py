"""What a step is planned from, for and among: plain data."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from kmpc_lite.control.margins import FeltNoise, Margins
from kmpc_lite.control.world.surroundings import Surroundings
from kmpc_lite.model.motion import MotionModel
from kmpc_lite.types import STATES, Array

NO_REFERENCE = np.empty((0, STATES))
"""Of a task that nothing is planned for."""


class Task(NamedTuple):
    """What a robot starts from in a step, what it steers for, and what it must be clear of."""

    model: MotionModel
    """Predicts; its number of past commands is the QP's."""
    past: Array
    """(L, 2) commands already sent, oldest first."""
    last: Array
    """(2,) the command sent last, zero of a robot that stands."""
    around: Surroundings
    """What is around the robot."""
    margins: Margins | None = None
    """Beyond the radii; without them no plan is refused."""
    felt: FeltNoise | None = None
    """The noise, as past innovations inflate it; given with `margins`."""
    reference: Array = NO_REFERENCE
    """(N + 1, 3) states to steer for."""
    to_goal: bool = False
    """Whether that is the goal itself, however far, at every stage."""
    path_clearance: float | Array = math.inf
    """What the path keeps from obstacles beyond the problem's margin [m], or at each stage,
    (N, 1)."""
    late: int = 0
    """Stages of the reference to which commands lead that were sent before."""
    curvature: float = 0.0
    """In which the wheels of a car stand now [1/m]."""
    terminal_share: float = 1.0
    """Part of the terminal weight that counts."""
    rolls_on: Array | None = None
    """(3,) by how much farther it comes than its model says; none if it answers as that says."""
    deadline: float = math.inf
    """When a plan must be there, on the clock of the SQP [s]."""
