"""What the guide is asked in a step."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight.view import View
    from kmpc_lite.control.world.solids import Solids


@dataclass(frozen=True, slots=True, eq=False)
class GuideTask:
    """From where to where, among what; poses are those of the tracked point."""

    pose: Array
    """(3,) of the robot [m, m, rad]."""
    goal: Array
    """(3,)."""
    circles: Array
    """(M, 7) what is round, now: a table of `kernels.clearance`."""
    solids: Solids | None = None
    """Polygons, walls and grids; unequal ones are another map."""
    rest: Array | None = None
    """Pose (3,) at which the robot would stand if it braked now; where it is, if not given."""
    until: float = math.inf
    """When to leave a search that is needed at once to the next step [s], on the guide's clock; the
    old path is kept meanwhile, and where there was none the robot stands."""
    view: View | None = None
    """What scans have shown: another path is looked for where that stands on the one driven."""
    speed: float = 0.0
    """That was commanded last, in either direction [m/s]."""
