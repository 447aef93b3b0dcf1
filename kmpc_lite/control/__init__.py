"""From a model and a pose to a command."""

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.obstacles import Circle
from kmpc_lite.control.occupancy import OccupancyGrid
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.shapes import Polygon, Wall

__all__ = ["Circle", "Controller", "NavigationProblem", "OccupancyGrid", "Plan", "PlanStatus", "Polygon", "Wall"]
