"""Which terms may explain each direction, in steps of ever more terms."""

from __future__ import annotations

Ladder = tuple[tuple[str, tuple[int, ...]], ...]
"""Names of its steps and the terms of each, of which there are ever more."""


ALONG_LADDER: Ladder = (
    ("gain", (0,)),
    ("gains", (0, 1)),
    ("product", (0, 1, 2)),
    ("slip", (0, 1, 2, 3, 4, 5)),
)
"""Terms of the forward speed: its own gain; a turning centre beside the pose; v*omega; what is even
in omega or saturates."""


ACROSS_LADDER: Ladder = (
    ("offset", (0,)),
    ("centre", (1,)),
    ("gains", (0, 1)),
    ("product", (0, 1, 2)),
    ("slip", (0, 1, 2, 6, 7, 8)),
)
"""Terms of the sideways speed: a heading that is off; a turning centre ahead of the pose; both;
v*omega; what is odd in omega."""


HEADING_LADDER: Ladder = (
    ("gain", (1,)),
    ("gains", (0, 1)),
    ("product", (0, 1, 2)),
    ("slip", (0, 1, 2, 6, 7, 8)),
)
"""Terms of the turn rate: its own gain; a robot that draws to one side; v*omega; what is odd in
omega."""


STEERED_LADDER: Ladder = (
    ("understeer", (1, 8)),
    ("draws", (0, 1, 8)),
    ("slip", (0, 1, 2, 6, 7, 8)),
)
"""Terms of a car's turn rate: its gain, and what tyres lose at speed; wheels that are not straight;
what is odd in omega."""


BESIDE = (0, 1, 2)
"""Terms of the sideways speed that are free where the forward speed's are chosen."""
