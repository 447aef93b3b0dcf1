"""Simulated robots whose motors lag and whose poses are noisy and old, on floors that change."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.sim.plants.robots import DifferentialDrive, checked, drawn_slip, slipped_arc
from kmpc_lite.errors import ProblemError
from kmpc_lite.learn.dataset import Dataset, Episode
from kmpc_lite.scenario.values import Floor
from kmpc_lite.types import INPUTS, STATES, Array

FINEST = 0.02  # longest step in which the speeds of lagging motors are held [s]


class LaggingDrive:
    """Two-wheeled robot that slips and follows its commands late: dead time, then first-order lag.

    ``dv/dt = (v_cmd(t - dead_time) - v) / lag``, the same for the turn rate; the slip of
    `DifferentialDrive` acts on the speeds that the motors have reached. It remembers its speeds and
    commands from call to call: `reset` between drives. One pose, or many robots at once.

    Parameters
    ----------
    lag : float
        Time constant of both motors [s]; 0 for none.
    dead_time : float
        Between a command and the motors' first reaction [s]; need not be a multiple of the period.
    slip, turn_gain, seed, turning_point
        As in `DifferentialDrive`.
    floors : sequence of Floor
        Changes of slip and turn gain, in order of time.

    Raises
    ------
    ProblemError
        For negative times, or floors out of order.

    Examples
    --------
    >>> robot, x = LaggingDrive(lag=0.3, dead_time=0.15), np.zeros(3)
    >>> for _ in range(3):
    ...     x = robot.step(x, [1.0, 0.0], 0.1)
    ...     print(x.round(4))
    [0. 0. 0.]
    [0.0039 0. 0. ]
    [0.032 0. 0. ]
    """

    def __init__(
        self,
        lag: float = 0.0,
        dead_time: float = 0.0,
        slip: float = 0.0,
        turn_gain: float = 1.0,
        seed: int = 0,
        floors: Sequence[Floor] = (),
        turning_point: ArrayLike = (0.0, 0.0),
    ) -> None:
        for name, value in (("lag", lag), ("dead_time", dead_time)):
            if not (np.isfinite(value) and value >= 0.0):
                raise ProblemError(f"{name}: expected a time >= 0 s, got {value}")
        if any(b.time <= a.time for a, b in zip(floors, floors[1:], strict=False)):
            raise ProblemError("floors: expected rising times")
        self.lag, self.dead_time, self.floors = float(lag), float(dead_time), tuple(floors)
        self._first = Floor(0.0, slip, turn_gain)
        for floor in (self._first, *floors):
            # checks them as the plain robot does
            self.turning_point = DifferentialDrive(
                floor.slip, 0, floor.turn_gain, turning_point
            ).turning_point
        self._random = np.random.default_rng(seed)
        self.reset()

    def reset(self) -> None:
        """Stand still on the first floor with no command on its way; the slip goes on at random."""
        self.time = 0.0
        self.speeds: Array = np.zeros(INPUTS)
        self._sent: deque[tuple[float, Array]] = deque()
        self._held: Array = np.zeros(INPUTS)

    @property
    def floor(self) -> Floor:
        """What is under the robot now."""
        return next((f for f in reversed(self.floors) if self.time >= f.time - 1e-9), self._first)

    def step(self, x: ArrayLike, u: ArrayLike, dt: float) -> Array:
        """State after one period: states (..., 3), commands (..., 2), dt [s] -> (..., 3)."""
        end: Array = self.trace(x, u, dt, 1)[0]
        return end

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """Evenly spaced states during one period, without the first: (substeps, ..., 3)."""
        state, command = checked(x, u)
        floor = self.floor
        ratios = drawn_slip(self._random, floor.slip, state.shape[:-1])
        self._sent.append((self.time + self.dead_time, command.copy()))
        self.speeds = np.broadcast_to(self.speeds, command.shape)
        self._held = np.broadcast_to(self._held, command.shape)
        path = np.empty((substeps, *state.shape))
        start = self.time
        for i in range(substeps):
            state = self._until(state, start + (i + 1) * dt / substeps, ratios, floor.turn_gain)
            path[i] = state
        return path

    def _until(self, state: Array, end: float, ratios: Array, turn_gain: float) -> Array:
        """Move the robot on to a time [s].

        Steps end where a command arrives, and are short while motors follow.
        """
        while end - self.time > 1e-9:
            while self._sent and self._sent[0][0] <= self.time + 1e-9:
                self._held = self._sent.popleft()[1]
            arrival = self._sent[0][0] if self._sent else np.inf
            h = min(end, arrival) - self.time
            if self.lag:
                h = min(h, FINEST)
                # exact for a held command; the mean over the step moves the robot
                decay = np.exp(-h / self.lag)
                mean = self._held + (self.speeds - self._held) * ((1.0 - decay) * self.lag / h)
                self.speeds = self._held + (self.speeds - self._held) * decay
            else:
                mean = self.speeds = self._held
            state = slipped_arc(state, mean * (1.0, turn_gain), ratios, h, self.turning_point)
            self.time += h
        self.time = end
        return state


def drive_log(
    plant: LaggingDrive,
    episodes: int = 100,
    steps: int = 400,
    dt: float = 0.1,
    seed: int = 0,
    u_max: ArrayLike = (0.6, 0.8),
    hold: int = 5,
    pose_noise: ArrayLike = (0.0, 0.0, 0.0),
) -> Dataset:
    """Record random drives as a log shows them: from rest, held commands, noisy poses.

    Parameters
    ----------
    plant : LaggingDrive
        What is driven; it is reset before.
    episodes, steps : int
        How many drives, and of how many periods.
    dt : float
        Period [s].
    seed : int
        Of starts, commands and pose noise.
    u_max : array_like
        Commands are uniform on [-u_max, u_max] (m/s, rad/s).
    hold : int
        Longest time that a command is held [periods]; each is held for 1 to `hold`.
    pose_noise : array_like
        Standard deviation of the logged poses [m, m, rad].
    """
    random = np.random.default_rng(seed)
    plant.reset()
    states = np.empty((episodes, steps + 1, STATES))
    states[:, 0] = random.uniform(-1.0, 1.0, (episodes, STATES))
    inputs = random.uniform(-1.0, 1.0, (episodes, steps, INPUTS)) * np.asarray(u_max)
    kept = random.integers(0, hold, (episodes, steps)) > 0
    for k in range(1, steps):
        inputs[kept[:, k], k] = inputs[kept[:, k], k - 1]
    for k in range(steps):
        states[:, k + 1] = plant.step(states[:, k], inputs[:, k], dt)
    states += random.normal(size=states.shape) * np.asarray(pose_noise)
    plant.reset()
    return Dataset([Episode(s, u, dt) for s, u in zip(states, inputs, strict=True)])
