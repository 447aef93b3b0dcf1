"""A Husarion ROSbot 2 in MuJoCo: four driven wheels that must slide to turn. Needs the extra ``twin``."""

from kmpc_lite.sim.twin.floors import FLOORS, Floor, Ground, Patch
from kmpc_lite.sim.twin.plant import Twin, TwinMissing

__all__ = ["FLOORS", "Floor", "Ground", "Patch", "Twin", "TwinMissing"]
