"""Drives whose answers were changed on purpose since they were recorded, and why."""

from __future__ import annotations

CONVERGED = (
    "passes to convergence set OSQP up anew in each step, so that a step does not depend on what "
    "the solver adapted in the steps before: off by less than 2e-4"
)
OTHER_RADIUS = (
    "lengths among the options are in robot radii: a robot of another radius than 0.15 m has other "
    "margins than the metres that were meant for the paper's"
)
ADAPTATION = (
    "adaptation refuses gains that no robot has, "
    "and a corrected model that predicts worse gives way"
)
SAME_MAP = "a map that is equal to the one before, though made anew, is no reason for a new path"
CHANGED: dict[int, str] = {
    1: SAME_MAP,
    9: ADAPTATION,
    **dict.fromkeys((27, 66, 85, 89, 109, 120, 130), CONVERGED),
    **dict.fromkeys((223, 228), OTHER_RADIUS),
}
"""Reasons by the number of the drive."""
