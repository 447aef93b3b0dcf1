"""Drives whose answers were changed since they were recorded, and why.

They were recorded with the last commit of 0.1 and held the redesign of `kmpc_lite.control` to 1e-9,
but for 22 drives that it changed on purpose (numbers in robot radii, copies of what callers pass,
passes to convergence, sense of adaptation). Margins of robots that lag, parking and the default
weights then changed on purpose for all, and they were recorded anew; and again when what a plan
leaves at its goal began to count for as long as it takes to make good, and what is sure of a
clearance alone to be spent. Answers to the same poses were taken anew (``record.py --answers``)
when robots that answer late came to be led from where the commands that were sent will have brought
them: 54 drives. By then 17 others had changed on purpose: stops that drive on keep their margin
(6), robots whose commands change slowly are led as they can brake (10), who only seems to touch is
slow past an obstacle (1).
"""

from __future__ import annotations

CHANGED: dict[int, str] = {}
"""Reasons by the number of the drive."""
