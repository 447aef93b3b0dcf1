"""What a plant is, and which one a scenario asks for."""

from __future__ import annotations

from typing import Protocol

from numpy.typing import ArrayLike

from kmpc_lab.sim.plants.lag import LaggingDrive
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lab.sim.plants.steered import MecanumDrive, SteeredDrive
from kmpc_lite.control.wheels import Car, Omni
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
