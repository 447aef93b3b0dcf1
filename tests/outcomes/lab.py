"""What the drives take from the simulations and studies: imported here alone."""

from kmpc_lab.sim.lidar import box_edges
from kmpc_lab.sim.maps.families import has_passage, random_map
from kmpc_lab.sim.pedestrians import Pedestrians, Walks
from kmpc_lab.studies.any_robot import Robot, random_robot
from kmpc_lab.studies.any_robot import learn as learn_robot
from kmpc_lab.studies.jumps import Jumps
from kmpc_lab.studies.maps import Condition
from kmpc_lab.studies.real import RealPlant, real_robot
from kmpc_lab.studies.sight.worlds import course_of as sight_course
from kmpc_lite.control.options import SightOptions
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.touch import footprint_gaps
from kmpc_lite.scenario.world import World, world_of

__all__ = [
    "Condition",
    "Jumps",
    "Pedestrians",
    "RealPlant",
    "Robot",
    "Scenario",
    "SightOptions",
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
