"""Drives whose answers were changed since they were recorded, and why.

They were recorded with the last commit of 0.1 and held the redesign of `kmpc_lite.control` to 1e-9,
but for 22 drives that it changed on purpose (numbers in robot radii, copies of what callers pass,
passes to convergence, sense of adaptation). Margins of robots that lag, parking and the default
weights then changed on purpose for all, and they were recorded anew; and again when what a plan
leaves at its goal began to count for as long as it takes to make good, and what is sure of a
clearance alone to be spent.
"""

from __future__ import annotations

BRAKES = (
    "a robot whose commands change slowly is led to its goal as it can brake before it, not at "
    "full speed to the end"
)
STOPS = (
    "a stop trajectory that drives on before it brakes keeps its whole margin, and a heading that "
    "is off leads it aside"
)
RETREATS = (
    "a robot that touches by less than its pose may err, and leads past the obstacle, is as slow "
    "as one a little beside it: the floor may push it on"
)
LEADS = (
    "a robot that answers late is led from where the commands that were sent will have brought it"
)
CHANGED: dict[int, str] = (
    dict.fromkeys(
        (
            3,
            7,
            9,
            11,
            14,
            20,
            25,
            27,
            31,
            32,
            42,
            49,
            59,
            65,
            68,
            69,
            82,
            85,
            95,
            98,
            104,
            125,
            126,
            128,
            130,
            131,
            141,
            150,
            151,
            158,
            167,
            178,
            183,
            186,
            187,
            189,
            193,
            200,
            219,
            221,
            228,
            235,
            240,
            242,
            250,
            255,
            256,
            258,
            267,
            270,
            275,
            280,
            281,
            283,
        ),
        LEADS,
    )
    | dict.fromkeys((13, 121, 136, 191, 246, 264), STOPS)
    | dict.fromkeys((0, 21, 43, 63, 71, 78, 155, 233, 247, 266), BRAKES)
    | {40: RETREATS}
)
"""Reasons by the number of the drive."""
