"""Plants, scenarios, closed loops and studies."""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from kmpc_lite.sim.closed_loop import Outcome, Run, drive
    from kmpc_lite.sim.plants.learned import LearnedPlant
    from kmpc_lite.sim.plants.robots import DifferentialDrive, generate_dataset
    from kmpc_lite.sim.scenario.files import Scenario

__all__ = [
    "DifferentialDrive",
    "LearnedPlant",
    "Outcome",
    "Run",
    "Scenario",
    "drive",
    "generate_dataset",
]

LATER = {
    "DifferentialDrive": "plants.robots",
    "LearnedPlant": "plants.learned",
    "Outcome": "closed_loop",
    "Run": "closed_loop",
    "Scenario": "scenario.files",
    "drive": "closed_loop",
    "generate_dataset": "plants.robots",
}


def __getattr__(name: str) -> Any:
    """Import what a robot's board does not need when it is asked for."""
    if name not in LATER:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{LATER[name]}"), name)
