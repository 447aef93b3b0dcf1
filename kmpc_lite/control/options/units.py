"""The lengths and speeds that options are multiples of."""

from __future__ import annotations

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.scale import UNIT_RADIUS


def unit_length(problem: NavigationProblem) -> float:
    """Metres that one radius stands for [m].

    The robot's, or that of its footprint's circles; the paper's for a point.
    """
    return problem.body_radius or UNIT_RADIUS


def fastest(problem: NavigationProblem) -> tuple[float, float]:
    """Largest speed [m/s] and turn rate [rad/s] that the command bounds allow in any direction."""
    *speeds, turn_rate = (
        max(float(above), -float(below))
        for above, below in zip(problem.u_max, problem.u_min, strict=True)
    )
    return max(speeds), turn_rate
