"""From a model and a pose to a command."""

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.footprint import Footprint
from kmpc_lite.control.options import ControllerOptions, GuidanceOptions
from kmpc_lite.control.plan import GoalProgress, Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.occupancy import OccupancyGrid
from kmpc_lite.control.world.scan import LaserScan
from kmpc_lite.control.world.shapes import Circle, Polygon, Wall

__all__ = [
    "Circle",
    "Controller",
    "ControllerOptions",
    "Footprint",
    "GoalProgress",
    "GuidanceOptions",
    "LaserScan",
    "NavigationProblem",
    "OccupancyGrid",
    "Plan",
    "PlanStatus",
    "Polygon",
    "Wall",
]
