"""Every number of the controller that someone may want to change, by room, with unit and reason.

Lengths are in robot radii [radii], speeds in shares of the fastest, times in seconds of a robot of
0.15 m and 0.6 m/s: another one takes `NavigationProblem.scale.time` times as long. So the same
options suit a large robot and a small one. Metres stand only where an accuracy is meant, seconds by
the clock where sensors set the pace (`clock_seconds`).
"""

from kmpc_lite.adaptation.options import AdaptationOptions
from kmpc_lite.control.options.control import (
    MarginOptions,
    OSQPOptions,
    PoseOptions,
    SolverOptions,
    StepOptions,
    StopOptions,
)
from kmpc_lite.control.options.controller import ControllerOptions
from kmpc_lite.control.options.guidance import GoalOptions, GuidanceOptions, MovingObstacleOptions
from kmpc_lite.control.options.sight import ObstacleOptions, SightOptions, TrackerOptions
from kmpc_lite.control.options.units import fastest, unit_length
from kmpc_lite.option_fields import lengths_from_radii

__all__ = [
    "AdaptationOptions",
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
    "lengths_from_radii",
    "unit_length",
]
