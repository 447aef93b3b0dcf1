"""Reads the fields of a problem: an error names the field, what was expected, and what came."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import ProblemError
from kmpc_lite.types import Array

LARGE = 1.0
"""Smaller radii are hardly centimetres that were taken for metres [m]."""
SLOWEST = 15.0
"""A robot that takes longer to drive its radius is hardly one [s]."""


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
