"""Drives whose answers were changed on purpose since they were recorded, and why."""

from __future__ import annotations

CONVERGED = (
    "passes to convergence set OSQP up anew in each step, so that a step does not depend on what "
    "the solver adapted in the steps before: off by less than 2e-4"
)
OTHER_UNITS = (
    "inside, every robot is its own unit: one of another radius than 0.15 m, or another fastest "
    "speed than 0.6 m/s, has margins, weights and tolerances that suit it"
)
OWN_COPY = "what the caller does to the arrays of a plan no longer reaches the controller"
ADAPTATION = (
    "adaptation refuses gains that no robot has, "
    "and a corrected model that predicts worse gives way"
)
SAME_MAP = "a map that is equal to the one before, though made anew, is no reason for a new path"
CHANGED: dict[int, str] = {
    1: SAME_MAP,
    9: ADAPTATION,
    **dict.fromkeys((27, 66, 85, 89, 109, 120, 130), CONVERGED),
    42: OWN_COPY,
    **dict.fromkeys((6, 223, 227, 228), OTHER_UNITS),
}
"""Reasons by the number of the drive."""
