"""The lengths and speeds that options are multiples of, and the checks that all options share."""

from __future__ import annotations

import math
from typing import Any

from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.errors import ProblemError

POINT_ROBOT = 0.15
"""Unit length of a robot without a radius [m]: the radius of the paper's robot."""


def unit_length(problem: NavigationProblem) -> float:
    """Metres that one radius stands for: the robot's radius, or the paper's for a point [m]."""
    return problem.robot_radius or POINT_ROBOT


def fastest(problem: NavigationProblem) -> tuple[float, float]:
    """Largest speed [m/s] and turn rate [rad/s] that the command bounds allow in any direction."""
    speed, turn_rate = (
        max(float(above), -float(below))
        for above, below in zip(problem.u_max, problem.u_min, strict=True)
    )
    return speed, turn_rate


def require_positive(options: Any, *names: str) -> None:
    """Raise ProblemError unless these fields are finite numbers > 0."""
    for name in names:
        if not (_is_number(value := getattr(options, name)) and value > 0.0):
            raise _error(options, name, "a number > 0")


def require_not_negative(options: Any, *names: str) -> None:
    """Raise ProblemError unless these fields are finite numbers >= 0."""
    for name in names:
        if not (_is_number(value := getattr(options, name)) and value >= 0.0):
            raise _error(options, name, "a number >= 0")


def require_share(options: Any, *names: str) -> None:
    """Raise ProblemError unless these fields are shares from 0 to 1."""
    for name in names:
        if not (_is_number(value := getattr(options, name)) and 0.0 <= value <= 1.0):
            raise _error(options, name, "a share from 0 to 1")


def require_probability(options: Any, *names: str) -> None:
    """Raise ProblemError unless these fields are probabilities between 0 and 1, neither of them."""
    for name in names:
        if not (_is_number(value := getattr(options, name)) and 0.0 < value < 1.0):
            raise _error(options, name, "a probability between 0 and 1")


def require_count(options: Any, *names: str) -> None:
    """Raise ProblemError unless these fields are whole numbers >= 1."""
    for name in names:
        value = getattr(options, name)
        if isinstance(value, bool) or not isinstance(value, int) or value < 1:
            raise _error(options, name, "a whole number >= 1")


def _is_number(value: Any) -> bool:
    return not isinstance(value, bool) and isinstance(value, int | float) and math.isfinite(value)


def _error(options: Any, name: str, expected: str) -> ProblemError:
    value = getattr(options, name)
    return ProblemError(f"{type(options).__name__}.{name}: expected {expected}, got {value!r}")
