"""Whether the numbers of one step are plausible.

What a broken sensor sends must not reach the solver.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.types import STATES, Array

POSITION_LIMIT = 1e4
"""A pose, a goal or an obstacle farther out [m], or a faster speed [m/s, rad/s], is taken for a
broken sensor."""
EXPECTED = f"expected finite numbers, none beyond {POSITION_LIMIT:g}"
"""What is told of numbers that are not plausible."""


def to_numbers(name: str, values: ArrayLike) -> Array:
    """Copy of what a caller gave, as numbers.

    Raises ValueError for what is none.
    """
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{name}: expected numbers: {error}") from error


def step_numbers(
    x: ArrayLike, goal: ArrayLike, sent: ArrayLike | None, inputs: int
) -> tuple[Array, Array, Array | None]:
    """Pose (3,), goal (3,) and command sent (inputs,) of a step, as numbers of any value.

    Raises ValueError for wrong shapes and what is no numbers, and for nothing else.
    """
    pose, target = to_numbers("x", x), to_numbers("goal", goal)
    if pose.shape != (STATES,) or target.shape != (STATES,):
        raise ValueError(
            f"x and goal: expected shape ({STATES},) each, got {pose.shape} and {target.shape}"
        )
    command = None if sent is None else to_numbers("sent", sent)
    if command is not None and command.shape != (inputs,):
        raise ValueError(f"sent: expected shape ({inputs},), got {command.shape}")
    return pose, target, command


def is_plausible(pose: Array) -> bool:
    """Whether a pose (3,), or a command (2,), is finite and within reach."""
    # three numbers are looked at faster one by one than as an array
    for value in pose.tolist():  # noqa: SIM110  # half the time of `all`
        if not abs(value) <= POSITION_LIMIT:  # also for NaN
            return False
    return True


def are_plausible(circles: Array) -> bool:
    """Whether obstacles (M, 5) are finite and within reach, and their radii not negative."""
    if not len(circles):
        return True
    return bool(
        np.maximum.reduce(np.abs(circles), axis=None) <= POSITION_LIMIT
        and np.minimum.reduce(circles[:, 2]) >= 0.0
    )


def first_implausible(circles: Array) -> Array:
    """Row (5,) of the first obstacle of (M, 5) that is not plausible, where one is."""
    wrong = ~(np.abs(circles) <= POSITION_LIMIT).all(axis=1) | (circles[:, 2] < 0.0)
    row: Array = circles[np.argmax(wrong)]
    return row
