"""What users give is checked: fields of a problem when it is made, arguments of every step."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ProblemError
from kmpc_lite.types import STATES, Array

POSITION_LIMIT = 1e4
"""A pose, a goal or an obstacle farther out [m], or a faster speed [m/s, rad/s], is taken for a
broken sensor."""
EXPECTED = f"expected finite numbers, none beyond {POSITION_LIMIT:g}"
"""What is told of numbers that are not plausible."""
LARGE = 1.0  # smaller radii are hardly centimetres that were taken for metres [m]
SLOWEST = 15.0  # a robot that takes longer to drive its radius is hardly one [s]


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


class Values:
    """Type of a field that takes whatever makes an array, and then is one."""

    if TYPE_CHECKING:

        def __get__(self, problem: object, kind: object) -> Array: ...
        def __set__(self, problem: object, value: ArrayLike | None) -> None: ...


class OptionalValues:
    """Type of such a field that is None if it is not given."""

    if TYPE_CHECKING:

        def __get__(self, problem: object, kind: object) -> Array | None: ...
        def __set__(self, problem: object, value: ArrayLike | None) -> None: ...


def given(value: ArrayLike | None) -> Any:
    """Give the default of such a field."""
    return value


def scalar(name: str, value: Any, above_zero: bool) -> None:
    """Raise ProblemError for what is no finite number >= 0, or > 0."""
    number = not isinstance(value, bool) and isinstance(value, int | float | np.number)
    if not number or not np.isfinite(value) or value < 0 or (above_zero and value == 0):
        raise ProblemError(
            f"{name}: expected a number {'> 0' if above_zero else '>= 0'}, got {value!r}"
        )


def stages(horizon: Any) -> None:
    """Raise ProblemError for what is no usable horizon."""
    whole = not isinstance(horizon, bool) and isinstance(horizon, int | np.integer)
    if not whole or not 1 <= horizon <= 200:
        raise ProblemError(
            f"horizon: expected a whole number of stages from 1 to 200, got {horizon!r}"
        )


def vector(name: str, value: Any, length: int) -> Array:
    """Array of so many numbers, infinite ones too."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(f"{name}: expected {length} numbers, got {_shown(value)}") from error
    if array.shape != (length,) or np.isnan(array).any():
        raise ProblemError(f"{name}: expected {length} numbers, got {_shown(value)}")
    return array


def positive(name: str, value: Any, length: int) -> Array:
    """Array of so many finite numbers > 0."""
    array = vector(name, value, length)
    if not (np.isfinite(array).all() and (array > 0).all()):
        raise ProblemError(f"{name}: expected finite numbers > 0, got {array}")
    return array


def weight(name: str, value: Any, size: int) -> Array:
    """Symmetric positive semidefinite (size, size) matrix from a diagonal or a full matrix."""
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError) as error:
        raise ProblemError(
            f"{name}: expected {size} weights or a ({size}, {size}) matrix, got {_shown(value)}"
        ) from error
    matrix = np.diag(array) if array.ndim == 1 else array
    if matrix.shape != (size, size) or not np.isfinite(matrix).all():
        raise ProblemError(
            f"{name}: expected {size} finite weights or a ({size}, {size}) matrix, "
            f"got {_shown(value)}"
        )
    if not np.allclose(matrix, matrix.T) or np.linalg.eigvalsh(matrix).min() < -1e-9 * max(
        1.0, np.abs(matrix).max()
    ):
        raise ProblemError(
            f"{name}: must be symmetric and positive semidefinite, got {_shown(value)}"
        )
    return matrix


def _shown(value: Any) -> str:
    """Value as one line of an error."""
    return repr(value.tolist() if isinstance(value, np.ndarray) else value)


def fits(name: str, radius: float, width: float, speed: float) -> None:
    """Raise ProblemError for a large radius [m] in a smaller area [m], or at a speed too low."""
    if radius <= LARGE:
        return
    doubt = ""
    if radius > width:
        doubt = f"more than the size of the area, {width:g} m"
    elif radius > SLOWEST * speed:
        doubt = f"more than the robot drives in {SLOWEST:g} s at {speed:g} m/s"
    if doubt:
        raise ProblemError(
            f"{name}: {radius:g} m is {doubt}; lengths are in metres, not in centimetres"
        )


def check_bounds(u_min: Array, u_max: Array, x_min: Array, x_max: Array, radius: float) -> None:
    """Raise ProblemError for bounds that leave nothing, or no way to brake."""
    if not (np.isfinite(u_min).all() and np.isfinite(u_max).all()):
        raise ProblemError(f"u_min, u_max: expected finite bounds, got {u_min} and {u_max}")
    if (u_min >= u_max).any():
        raise ProblemError(f"u_min, u_max: bounds cross: {u_min} and {u_max}")
    if (u_min > 0).any() or (u_max < 0).any():
        raise ProblemError(
            "u_min, u_max: must contain the zero command, or the robot could not brake; "
            f"got {u_min} and {u_max}"
        )
    if (x_min >= x_max).any():
        raise ProblemError(f"x_min, x_max: bounds cross: {x_min} and {x_max}")
    fastest = float(np.maximum(u_max, -u_min)[:-1].max())
    fits("robot_radius", radius, float((x_max - x_min)[:2].max()), fastest)
    if np.isfinite(x_min[2]) or np.isfinite(x_max[2]):
        raise ProblemError(
            "x_min, x_max: the heading cannot be bounded; use -inf and inf, "
            f"got {x_min[2]} and {x_max[2]}"
        )


def check_track(track: float, speed: float) -> None:
    """Raise ProblemError for half a pair of wheels, which are told by distance and speed."""
    if not isinstance(speed, bool) and speed == np.inf:
        if track:
            raise ProblemError("max_wheel_speed: missing: a track limits commands together with it")
        return
    scalar("max_wheel_speed", speed, above_zero=True)
    if not track:
        raise ProblemError("track: missing: expected the distance between the wheels [m] > 0")
