"""Every number of the controller that someone may want to change, by room, with unit and reason.

Lengths are in robot radii [radii], times in seconds, speeds in shares of the fastest, so that the
same options suit a large robot and a small one. Metres stand only where an accuracy is meant.
"""

from kmpc_lite.control.options.controller import ControllerOptions
from kmpc_lite.control.options.fields import in_metres
from kmpc_lite.control.options.goal import GoalOptions
from kmpc_lite.control.options.guidance import GuidanceOptions
from kmpc_lite.control.options.margins import MarginOptions
from kmpc_lite.control.options.moving_obstacles import MovingObstacleOptions
from kmpc_lite.control.options.obstacles import ObstacleOptions
from kmpc_lite.control.options.pose import PoseOptions
from kmpc_lite.control.options.sight import SightOptions
from kmpc_lite.control.options.solver import OSQPOptions, SolverOptions
from kmpc_lite.control.options.step import StepOptions
from kmpc_lite.control.options.stop import StopOptions
from kmpc_lite.control.options.tracker import TrackerOptions
from kmpc_lite.control.options.units import fastest, unit_length

__all__ = [
    "ControllerOptions",
    "GoalOptions",
    "GuidanceOptions",
    "MarginOptions",
    "OSQPOptions",
    "ObstacleOptions",
    "SightOptions",
    "PoseOptions",
    "SolverOptions",
    "StepOptions",
    "StopOptions",
    "TrackerOptions",
    "MovingObstacleOptions",
    "fastest",
    "in_metres",
    "unit_length",
]
