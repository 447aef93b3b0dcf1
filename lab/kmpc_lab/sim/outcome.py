"""How a simulated drive ended, and why it did not arrive."""

from __future__ import annotations

from enum import Enum
from typing import Any

import numpy as np

from firmware_bridge.runtime.reasons import ended_words
from firmware_bridge.runtime.route import Route
from kmpc_lite.control.plan import Plan
from kmpc_lite.geometry import distances, wrap
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.types import Array


class Outcome(Enum):
    """How a drive ended."""

    REACHED = "reached"
    COLLISION = "collision"
    TIMEOUT = "timeout"


def why_not(
    outcome: Outcome, scenario: Scenario, route: Route, plan: Plan, x: Array, duration: float
) -> dict[str, Any]:
    """Say in one sentence why a drive that ended at a state (3,) did not arrive; else nothing."""
    if outcome is Outcome.REACHED:
        return {}
    goal = np.array(route.goal)
    errors = float(distances(x, goal)), abs(wrap(float(x[2]) - goal[2]))
    if outcome is Outcome.COLLISION:
        return {"ended": ended_words("touched an obstacle", duration, errors, route.words, ())}
    reason = plan.reason or "the robot was still driving"
    if plan.holding:
        reason = (
            f"the robot holds, but arrived means within {scenario.tolerance:g} m and "
            f"{scenario.heading_tolerance:g} rad"
        )
    return {"ended": ended_words("time is up", duration, errors, route.words, (reason,))}
