"""Plants, scenarios, closed loops and studies."""

from kmpc_lite.sim.closed_loop import LearnedPlant, Outcome, Run, drive
from kmpc_lite.sim.robots import DifferentialDrive, generate_dataset
from kmpc_lite.sim.scenario import Scenario

__all__ = ["DifferentialDrive", "LearnedPlant", "Outcome", "Run", "Scenario", "drive", "generate_dataset"]
