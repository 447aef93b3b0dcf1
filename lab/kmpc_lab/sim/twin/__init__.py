"""A Husarion ROSbot 2 in MuJoCo, whose four driven wheels slide to turn (extra ``twin``)."""

from kmpc_lab.sim.twin.plant import FLOORS, Floor, Ground, Patch, Twin, TwinMissing

__all__ = ["FLOORS", "Floor", "Ground", "Patch", "Twin", "TwinMissing"]
