"""What the guide sees in one step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from kmpc_lite.control.guidance.capabilities import Capabilities
from kmpc_lite.control.guidance.moving_obstacles import MovingObstacles
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.obstacles.sight.view import View
    from kmpc_lite.control.obstacles.solids import Solids


@dataclass(slots=True)
class Situation:
    """Robot, goal and obstacles now; poses are those of the turning centre."""

    pose: Array
    """(3,)."""
    goal: Array
    """(3,)."""
    target: Array
    """Goal of the tracked pose (3,)."""
    error: Array
    """Pose less goal (3,), the heading's in [-pi, pi]."""
    rest_error: Array
    """The same of the pose at which the robot stands if it brakes now."""
    distance: float
    """To the goal [m]."""
    circles: Array
    """(M, 5)."""
    solids: Solids | None
    moving: MovingObstacles | None
    """The circles, if any of them moves."""
    capabilities: Capabilities
    outside: bool
    """Whether the goal lies outside the area; then `goal` is the nearest pose inside."""
    until: float
    """When to leave a search to the next step [s]."""
    view: View | None = None
    """What scans have shown; none without any."""

    def met(self, waited: float) -> Array:
        """Circles (M, 5) where the robot meets them, which has stood for them so long [s]."""
        moving = self.moving
        return self.circles.copy() if moving is None else moving.where_met(self.pose, waited)

    @property
    def told(self) -> Array:
        """Circles (K, 5) that do as they are told: who was seen to move is no part of the map."""
        moving = self.moving
        if moving is None or moving.spread is None:
            return self.circles
        told: Array = self.circles[moving.spread == 0.0]
        return told


def lies_outside(goal: Array, low: list[float], high: list[float], tolerance: float) -> bool:
    """Whether a goal (3,) lies outside the area by more than a tolerance [m]."""
    x, y, _ = goal.tolist()
    inside_x = low[0] - tolerance <= x <= high[0] + tolerance
    return not (inside_x and low[1] - tolerance <= y <= high[1] + tolerance)
