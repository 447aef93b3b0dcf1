"""What it costs to drive where no scanner looks: the time of the looks that it takes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from kmpc_lite.control.path.capabilities import Capabilities
from kmpc_lite.types import Array

if TYPE_CHECKING:
    from kmpc_lite.control.world.sight.view import View

GEARS = 0.0, math.pi
"""Where a robot drives to, in its frame [rad]: forwards, backwards."""


def look_times(
    view: View | None, capabilities: Capabilities, points: Array, plan_time: float
) -> tuple[float, float]:
    """How long a robot stops on its way to look, driving forwards, and backwards [s].

    Where no scanner looks in the direction in which it drives, it turns round to look, and back,
    each time it has come to the end of what it saw: that is as far as plans lead.

    Parameters
    ----------
    view : View or None
        What scans have shown.
    capabilities : Capabilities
        Speeds.
    points : ndarray
        (n, 2) corners of about the way that it takes [m].
    plan_time : float
        How long a plan is [s].
    """
    if view is None or not view.is_narrow:
        return 0.0, 0.0
    speed, turn_rate = capabilities.forward.tolist()
    unknown = view.unknown_length(points)
    looks = max(unknown / (speed * plan_time), 1.0) if unknown else 0.0
    ahead, behind = (2.0 * looks * view.blind_turn(gear) / turn_rate for gear in GEARS)
    return ahead, behind
