"""What the drives take from the simulations and studies: imported here alone."""

from kmpc_lite.control.options import MovingObstacleOptions, SightOptions
from kmpc_lite.sim.lidar import World, box_edges, world_of
from kmpc_lite.sim.maps.families import has_passage, random_map
from kmpc_lite.sim.pedestrians import Pedestrians, Walks
from kmpc_lite.sim.scenario.files import Scenario
from kmpc_lite.sim.touch import footprint_gaps
from kmpc_lite.studies.any_robot import Robot, random_robot
from kmpc_lite.studies.any_robot import learn as learn_robot
from kmpc_lite.studies.broken_solver import BrokenWorkspace, Switch
from kmpc_lite.studies.conditions import Condition
from kmpc_lite.studies.jumps import Jumps
from kmpc_lite.studies.real_robots import RealPlant, real_robot
from kmpc_lite.studies.sight.worlds import course_of as sight_course

__all__ = [
    "BrokenWorkspace",
    "Condition",
    "Jumps",
    "MovingObstacleOptions",
    "Pedestrians",
    "RealPlant",
    "Robot",
    "Scenario",
    "SightOptions",
    "Switch",
    "Walks",
    "World",
    "box_edges",
    "footprint_gaps",
    "has_passage",
    "learn_robot",
    "random_map",
    "random_robot",
    "real_robot",
    "sight_course",
    "world_of",
]
