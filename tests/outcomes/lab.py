"""What the drives take from the simulations and studies: imported here alone."""

from kmpc_lab.sim.lidar import box_edges as box_edges
from kmpc_lab.sim.maps import has_passage as has_passage
from kmpc_lab.sim.maps import random_map as random_map
from kmpc_lab.sim.pedestrians import Pedestrians as Pedestrians
from kmpc_lab.sim.pedestrians import Walks as Walks
from kmpc_lab.studies import any_robot, sight
from kmpc_lab.studies.any_robot import Robot as Robot
from kmpc_lab.studies.any_robot import random_robot as random_robot
from kmpc_lab.studies.jumps import Jumps as Jumps
from kmpc_lab.studies.maps import Condition as Condition
from kmpc_lab.studies.real import RealPlant as RealPlant
from kmpc_lab.studies.real import real_robot as real_robot
from kmpc_lite.scenario.files import Scenario as Scenario
from kmpc_lite.scenario.touch import footprint_gaps as footprint_gaps
from kmpc_lite.scenario.world import World as World
from kmpc_lite.scenario.world import world_of as world_of

learn_robot, sight_course = any_robot.learn, sight.course_of
