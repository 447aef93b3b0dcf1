"""Safe motions: commands that end at rest, and which of them stay clear until then.

A motion is a coming command followed by a brake: down the ramp on the curve that the robot is on,
or along the plan's path. Sizes: C motions; T periods; S samples a period; E circles that make up
the robot's outline; K things.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from kmpc_lite.control.kernels.scan_map import Bits
from kmpc_lite.types import Array

TINY = 1e-9
"""Sizes of commands, in periods of braking, and lengths [m] that count as none."""
TINY_STEP = 1e-4
"""Step of numerical differences, as a share of the robot's radius."""
SLOWER = 14
"""Coming commands that are tried instead of a plan's."""
MOST_SAMPLES = 8
"""Most samples a period."""


class Brakes(NamedTuple):
    """How a robot brakes."""

    step: Array
    """(m,) by how much a braked command may shrink in a period."""
    faster: Array
    """(m,) by how much commands may change in a period, away from zero ..."""
    slower: Array
    """(m,) ... and towards it."""
    curvature: float
    """Largest one that wheels can be steered to [1/m]."""
    longest: int
    """Most periods of a brake."""
    further: int
    """How many further commands of a plan are tried."""


class Motions(NamedTuple):
    """Candidates, the best first."""

    commands: Array
    """(C, T, m), to zero."""
    strict: Bits
    """(C,) whether each must keep its margins, whatever clearance a standing robot has."""
    turns: Bits
    """(C,) whether it begins with a slow turn on the spot."""
    ends: NDArray[np.intc]
    """(C,) after how many periods it commands zero for good."""


def samples_a_period(longest: float, radius: float) -> int:
    """How many samples of a longest step [m] have chords that are short beside a radius [m]."""
    return min(max(math.ceil(longest / max(0.25 * radius, TINY)), 1), MOST_SAMPLES)
