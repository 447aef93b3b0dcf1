"""The public names of kmpc_lite: `kmpc_lite.X` imports this file when the first X is asked for."""

import importlib
import typing

from kmpc_lite.control import *
from kmpc_lite.control.path.planner import Path, PathRequest, Planner
from kmpc_lite.control.wheels import Car, Differential, Omni
from kmpc_lite.errors import DataError, KmpcError, ModelError, ProblemError, ScenarioError
from kmpc_lite.model.dictionary import (
    Dictionary,
    HermiteTrigDictionary,
    InputHistoryDictionary,
    UnicycleDictionary,
)
from kmpc_lite.model.koopman import KoopmanModel, nominal_omni, nominal_unicycle

if typing.TYPE_CHECKING:
    from kmpc_lite.embedded import *
    from kmpc_lite.learn import *

__all__ = [
    "Accumulator",
    "Car",
    "Circle",
    "CompiledController",
    "CompiledPlan",
    "Controller",
    "ControllerOptions",
    "DataError",
    "Dataset",
    "Dictionary",
    "Differential",
    "Episode",
    "FitReport",
    "Footprint",
    "GoalProgress",
    "GuidanceOptions",
    "HermiteTrigDictionary",
    "InputHistoryDictionary",
    "KmpcError",
    "KoopmanModel",
    "LaserScan",
    "ModelError",
    "NavigationProblem",
    "OccupancyGrid",
    "Omni",
    "Path",
    "PathRequest",
    "Plan",
    "PlanStatus",
    "Planner",
    "Polygon",
    "ProblemError",
    "ScenarioError",
    "UnicycleDictionary",
    "Wall",
    "evaluate",
    "export",
    "fit",
    "nominal_omni",
    "nominal_unicycle",
    "with_quantiles",
]
_LATER = {
    "kmpc_lite.embedded": "CompiledController CompiledPlan export".split(),
    "kmpc_lite.learn": "Accumulator Dataset Episode FitReport evaluate fit with_quantiles".split(),
}
"""Names that a robot which drives does not need: their modules are imported when they are."""

if not typing.TYPE_CHECKING:

    def __getattr__(name: str) -> typing.Any:
        """Import a name of `_LATER`."""
        for module, names in _LATER.items():
            if name in names:
                return getattr(importlib.import_module(module), name)
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
