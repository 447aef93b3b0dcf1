"""The public names of kmpc_lite: `kmpc_lite.X` imports this file when the first X is asked for."""

from kmpc_lite.control import (
    Circle,
    Controller,
    ControllerOptions,
    Footprint,
    GoalProgress,
    GuidanceOptions,
    LaserScan,
    NavigationProblem,
    ObstacleTracker,
    OccupancyGrid,
    Plan,
    PlanStatus,
    Polygon,
    Wall,
)
from kmpc_lite.control.path.planner import Path, PathRequest, Planner
from kmpc_lite.control.wheels import Car, Differential, Omni
from kmpc_lite.errors import DataError, KmpcError, ModelError, ProblemError, ScenarioError
from kmpc_lite.learn import Accumulator, Dataset, Episode, FitReport, evaluate, fit, with_quantiles
from kmpc_lite.model.dictionary import (
    Dictionary,
    HermiteTrigDictionary,
    InputHistoryDictionary,
    UnicycleDictionary,
)
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_omni, nominal_unicycle

__all__ = [
    "Accumulator",
    "Car",
    "Circle",
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
    "ObstacleTracker",
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
    "fit",
    "nominal_omni",
    "nominal_unicycle",
    "with_quantiles",
]
