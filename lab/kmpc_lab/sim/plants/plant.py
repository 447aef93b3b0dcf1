"""What a plant is, which one a scenario asks for, and one that does as a learned model says."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.sim.plants.steered import MecanumDrive, SteeredDrive
from kmpc_lite.control.wheels import Car, Omni
from kmpc_lite.geometry import rotate
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array


class Plant(Protocol):
    """Whatever can be driven."""

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """States (substeps, 3) during one period."""


def scenario_plant(scenario: Scenario) -> Plant:
    """Build the robot of a scenario: one that lags where motors lag or the floor changes."""
    if isinstance(scenario.wheels, Car):
        return SteeredDrive(scenario.wheels, scenario.slip, seed=scenario.seed)
    if isinstance(scenario.wheels, Omni):
        return MecanumDrive(scenario.slip, scenario.seed)
    if scenario.lag or scenario.dead_time or scenario.floors:
        return LaggingDrive(
            scenario.lag,
            scenario.dead_time,
            scenario.slip,
            scenario.turn_gain,
            scenario.seed,
            scenario.floors,
            scenario.turning_point,
        )
    return DifferentialDrive(
        scenario.slip, scenario.seed, scenario.turn_gain, scenario.turning_point
    )


class LearnedPlant:
    """A plant that behaves as a learned model predicts, with the noise that the model learned.

    For a robot of which there is only a log. It remembers its own past commands. Only the part of
    the covariance that grows with the speeds moves it: what is left at rest is the noise of the
    measured pose.

    Parameters
    ----------
    model : KoopmanModel
        Its period is the plant's.
    seed : int
        Of the noise.
    """

    def __init__(self, model: KoopmanModel, seed: int = 0) -> None:
        self.model = model
        self._random = np.random.default_rng(seed)
        self._past = np.zeros((model.history, model.inputs))

    def trace(self, x: ArrayLike, u: ArrayLike, dt: float, substeps: int) -> Array:
        """States (substeps, 3) during one period, evenly spaced between the predicted ends."""
        state, command = np.asarray(x, dtype=float), np.asarray(u, dtype=float)
        covariance = self.model.noise(command) - self.model.noise(np.zeros(self.model.inputs))
        noise = self._random.multivariate_normal(np.zeros(3), covariance, method="eigh")
        end = self.model.predict(state, command, self._past)
        end = end + (*rotate(noise[0], noise[1], state[2]), noise[2])
        self._past = (
            np.concatenate([self._past[1:], command[None]]) if len(self._past) else self._past
        )
        share = np.arange(1, substeps + 1)[:, None] / substeps
        path: Array = state + share * (end - state)
        return path
