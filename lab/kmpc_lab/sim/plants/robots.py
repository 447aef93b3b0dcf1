"""Plants: what the controller does not know."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.errors import DataError, ProblemError
from kmpc_lite.geometry import exact_arc
from kmpc_lite.learn.dataset import Dataset, Episode, check_time
from kmpc_lite.types import INPUTS, STATES, Array


class DifferentialDrive:
    """Two-wheeled robot on a floor that slips (paper, eq. 13).

    ``x' = (v + v_t) cos + v_s sin``, ``y' = (v + v_t) sin - v_s cos``, ``theta' = omega + omega_s``
    with ``v_s = alpha v``, ``v_t = beta v``, ``omega_s = gamma omega``; alpha, beta and gamma are
    exponential with mean `slip`, drawn anew every period and held during it. They are not negative:
    slip lengthens motion (E[v_t] > 0), and with more of it a robot arrives earlier.

    Parameters
    ----------
    slip : float
        Mean of the three slip ratios, >= 0.
    turn_gain : float
        How much of a commanded turn happens before the slip: skid-steer robots have 0.3 to 0.7.
    seed : int
        Of the slip.
    turning_point : array_like
        Where the point about which it turns on the spot lies, as seen from the pose: ahead, left
        (2,) [m]. Not zero for a marker that is off the axle's middle, or weight that is.

    Examples
    --------
    >>> DifferentialDrive().step([0.0, 0.0, 0.0], [1.0, 0.0], 0.1).round(3)
    array([0.1, 0. , 0. ])
    """

    def __init__(
        self,
        slip: float = 0.0,
        seed: int = 0,
        turn_gain: float = 1.0,
        turning_point: ArrayLike = (0.0, 0.0),
    ) -> None:
        if not (np.isfinite(slip) and slip >= 0.0):
            raise ProblemError(f"slip: expected a mean ratio >= 0, got {slip}")
        if not (np.isfinite(turn_gain) and turn_gain > 0.0):
            raise ProblemError(f"turn_gain: expected a factor > 0, got {turn_gain}")
        self.turning_point = np.asarray(turning_point, dtype=float)
        if self.turning_point.shape != (2,) or not np.isfinite(self.turning_point).all():
            raise ProblemError(
                f"turning_point: expected two finite distances [m], got {turning_point!r}"
            )
        self.slip, self.turn_gain = float(slip), float(turn_gain)
        self._random = np.random.default_rng(seed)

    def step(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """State after one period: states (..., 3), commands (..., 2), dt [s] -> (..., 3)."""
        end: Array = self.trace(x, u, dt, 1)[0]
        return end

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states during one period, without the first: (substeps, ..., 3)."""
        state, command = checked(x, u)
        # each robot slips on its own, whoever shares a command
        lead = np.broadcast_shapes(state.shape[:-1], command.shape[:-1])
        speeds = np.broadcast_to(command, (*lead, INPUTS)) * (1.0, self.turn_gain)
        ratios = drawn_slip(self._random, self.slip, lead)
        t = (dt / substeps * np.arange(1, substeps + 1)).reshape(-1, *(1 for _ in lead))
        state = np.broadcast_to(state, (*lead, STATES))
        return slipped_arc(state, speeds, ratios, t, self.turning_point)


def checked(x: ArrayLike, u: ArrayLike) -> tuple[Array, Array]:
    """States (..., 3) and commands (..., 2) as arrays; ValueError for other shapes."""
    state, command = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
    if state.shape[-1:] != (STATES,) or command.shape[-1:] != (INPUTS,):
        raise ValueError(
            f"expected states (..., 3) and commands (..., 2), got {state.shape} and {command.shape}"
        )
    return state, command


def drawn_slip(random: np.random.Generator, mean: float, lead: tuple[int, ...]) -> Array:
    """Draw the three slip ratios of each robot, (3, ...)."""
    return random.exponential(mean, (3, *lead)) if mean else np.zeros((3, *lead))


def slipped_arc(
    state: Array, speeds: Array, ratios: Array, t: Array | float, turning_point: Array
) -> Array:
    """Move slipping robots exactly along arcs at held speeds (paper, eq. 13).

    States are (..., 3), speeds (..., 2), ratios (3, ...).
    """
    alpha, beta, gamma = ratios
    v, turn = speeds[..., 0], (1.0 + gamma) * speeds[..., 1]
    # the pose goes around the turning point
    forward = (1.0 + beta) * v + turn * turning_point[1]
    left = -alpha * v - turn * turning_point[0]
    return exact_arc(state, forward, turn, t, left)


def generate_dataset(
    plant: DifferentialDrive,
    episodes: int = 1000,
    steps: int = 1000,
    dt: float = 0.1,
    seed: int = 0,
    u_max: ArrayLike = (1.0, 1.0),
    x_max: ArrayLike = (1.0, 1.0, 1.0),
) -> Dataset:
    """Drive at random, as the paper trains (sec. V.A): uniform commands, uniform starts.

    Parameters
    ----------
    plant : DifferentialDrive
        What is driven; all episodes at once.
    episodes, steps : int
        How many drives, and of how many periods.
    dt : float
        Period [s].
    seed : int
        Of starts and commands.
    u_max, x_max : array_like
        Commands are uniform on [-u_max, u_max] (m/s, rad/s), starts on [-x_max, x_max] (m, m, rad).

    Raises
    ------
    DataError
        For no episodes, no steps, or a period that is none.
    """
    if episodes < 1 or steps < 1:
        raise DataError(
            "generate_dataset: expected at least one episode of at least one step, "
            f"got {episodes} of {steps}"
        )
    dt = check_time("dt", dt)
    random = np.random.default_rng(seed)
    states = np.empty((episodes, steps + 1, STATES))
    states[:, 0] = random.uniform(-1.0, 1.0, (episodes, STATES)) * np.asarray(x_max)
    inputs = random.uniform(-1.0, 1.0, (episodes, steps, 2)) * np.asarray(u_max)
    for k in range(steps):
        states[:, k + 1] = plant.step(states[:, k], inputs[:, k], dt)
    return Dataset([Episode(s, u, dt) for s, u in zip(states, inputs, strict=True)])
