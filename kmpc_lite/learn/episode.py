"""One stretch of driving without a gap: checked once, and put on an even grid of times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.files import real_array
from kmpc_lite.geometry import rotate
from kmpc_lite.types import INPUTS, STATES, Array

MAX_ROWS = 10_000_000
"""Rows of the longest log that is taken in, or made by resampling."""


@dataclass(frozen=True, eq=False)
class Episode:
    """One stretch of driving without a gap.

    Parameters
    ----------
    states : ndarray
        Poses (T + 1, 3): x [m], y [m], theta [rad]; the heading is unwrapped here.
    inputs : ndarray
        Commands (T, 2): v [m/s], omega [rad/s], or (T, 3) of an omni: v_x, v_y, omega; row k acts
        from state k to state k + 1.
    dt : float
        Sampling period [s].
    steered : bool
        Whether its turn rates are those of steered wheels, a car's: speed times curvature.

    Raises
    ------
    DataError
        For other shapes, NaN, infinity, or fewer than two states.
    """

    states: Array
    inputs: Array
    dt: float
    steered: bool = False

    def __post_init__(self) -> None:
        """Check the arrays and unwrap the heading."""
        states, inputs = (
            real_array(self.states, "episode states", DataError),
            real_array(self.inputs, "episode inputs", DataError),
        )
        if states.ndim != 2 or states.shape[1] != STATES or len(states) < 2:
            raise DataError(
                f"episode states: expected shape (T + 1, {STATES}) with T >= 1, got {states.shape}"
            )
        steps = len(states) - 1
        if inputs.shape not in ((steps, INPUTS), (steps, INPUTS + 1)):
            raise DataError(
                f"episode inputs: expected shape ({steps}, {INPUTS}), one row per step, "
                f"got {inputs.shape}; an omni has {INPUTS + 1} columns"
            )
        dt = check_time("episode dt", self.dt)
        for name, array in (("states", states), ("inputs", inputs)):
            if not np.isfinite(array).all():
                row, column = np.argwhere(~np.isfinite(array))[0]
                raise DataError(
                    f"episode {name}: row {row}, column {column} is {array[row, column]}; "
                    "expected finite numbers"
                )
        if np.any(np.abs(np.diff(states[:, 2])) > np.pi):
            states = states.copy()
            states[:, 2] = np.unwrap(states[:, 2])
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "dt", dt)

    def __len__(self) -> int:
        """Count the steps, T."""
        return len(self.inputs)

    @property
    def moved(self) -> Array:
        """How far the robot went along its middle heading, and turned, in each period, (T, m).

        Of an omni also how far it went to the left.
        """
        steps = np.diff(self.states, axis=0)
        middle = self.states[:-1, 2] + 0.5 * steps[:, 2]
        ahead, left = rotate(steps[:, 0], steps[:, 1], -middle)
        went = [ahead, left, steps[:, 2]]
        return np.column_stack(went if self.inputs.shape[1] > INPUTS else went[::2])

    def resample(self, dt: float) -> Episode | None:
        """Return the same drive at another period [s], or None if it is shorter than one period.

        Poses are interpolated linearly; a command is the mean of what was held during the new
        period. DataError where the robot turns by more than half a turn within it.
        """
        time = np.arange(len(self) + 1) * self.dt
        return resample(time, self.states, self.inputs, dt, self.steered)


def check_time(name: str, value: float) -> float:
    """Give back a time [s] as a float, or raise DataError naming it."""
    time = real_array(value, name, DataError)
    if time.size != 1 or not (np.isfinite(time).all() and (time > 0.0).all()):
        raise DataError(f"{name}: expected a time > 0 s, got {value}")
    return float(time.item())


def resample(
    time: Array, states: Array, inputs: Array, dt: float, steered: bool = False
) -> Episode | None:
    """Put a drive on an even grid of times.

    The states (T + 1, 3) are at times (T + 1,) [s], and the inputs (T, m) act between them.
    """
    dt = check_time("dt", dt)
    elapsed = time - time[0]
    if elapsed[-1] > MAX_ROWS * dt:
        raise DataError(
            f"dt: {dt:g} s would cut a drive of {elapsed[-1]:g} s into more than {MAX_ROWS:,} steps"
        )
    steps = int(np.floor(elapsed[-1] / dt + 1e-6))
    if steps < 1:
        return None
    grid = np.arange(steps + 1) * dt
    travelled = np.vstack(
        [np.zeros(inputs.shape[1]), np.cumsum(inputs * np.diff(time)[:, None], axis=0)]
    )
    poses = np.column_stack([np.interp(grid, elapsed, column) for column in states.T])
    held = np.column_stack([np.interp(grid, elapsed, column) for column in travelled.T])
    turn = np.abs(np.diff(poses[:, 2])).max()
    if turn > np.pi:  # an episode would take it for the shorter turn the other way
        raise DataError(
            f"dt: within {dt:g} s the robot turns by {turn:.2f} rad, more than half a turn: "
            "choose a shorter period"
        )
    return Episode(poses, np.diff(held, axis=0) / dt, dt, steered)
