"""Drives whose answers were changed since they were recorded, and why."""

from __future__ import annotations

CONVERGED = (
    "passes to convergence set OSQP up anew in each step, so that a step does not depend on what "
    "the solver adapted in the steps before: off by less than 2e-4"
)
OTHER_UNITS = (
    "lengths among the options are in robot radii, speeds in shares of the fastest: a robot of "
    "another radius than 0.15 m or another bound than 0.6 m/s has other numbers than the paper's"
)
PERIOD = (
    "adaptation looks back over seconds: with a period of 0.05 s its window is 40 steps, not 20"
)
REFUSED = (
    "adaptation refuses gains that no floor causes: less than a fifth of every turn, or more than "
    "2.5 times as much; a model that is found wrong twice stops the robot"
)
SAME_MAP = "a map that is equal to the one before, though made anew, is no reason for a new path"
OWN_COPY = "what the caller does to the arrays of a plan no longer reaches the controller"
FAR_WALLS = (
    "arcs that make room ask for walls within another reach, and the plan's walls were looked up "
    "anew after that: which walls beyond the reach of the plan count has changed, none within it"
)
CHANGED: dict[int, str] = {
    38: FAR_WALLS,
    56: OWN_COPY,
    87: SAME_MAP,
    277: PERIOD,
    **dict.fromkeys((65, 205), REFUSED),
    **dict.fromkeys((20, 108, 128, 139, 154, 195, 196), CONVERGED),
    **dict.fromkeys((63, 67, 78, 134, 141, 149, 170, 218, 269), OTHER_UNITS),
}
"""Reasons by the number of the drive."""
