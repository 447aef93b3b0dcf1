"""Which terms may explain each direction, in steps of ever more terms."""

from __future__ import annotations

from typing import NamedTuple

from kmpc_lite.model.dictionary.terms import OMNI_TERMS, TERMS

Ladder = tuple[tuple[str, tuple[int, ...]], ...]
"""Names of its steps and the terms of each, of which there are ever more."""


class Ladders(NamedTuple):
    """Of one kind of wheels."""

    along: Ladder
    """Terms of the forward speed: its own gain; a turning centre beside the
    pose; v*omega; what is even in omega or saturates."""
    across: Ladder
    """Terms of the sideways speed: a heading that is off; a turning centre ahead of the pose; both;
    v*omega; what is odd in omega."""
    heading: Ladder
    """Terms of the turn rate: its own gain; a robot that draws to one side; v*omega; what is odd in
    omega."""
    beside: tuple[int, ...]
    """Terms of the sideways speed that are free where the forward speed's are chosen."""

    gears: tuple[int, int] | None = None
    """Terms by which forward speed and turn rate differ in reverse, tried beside the others."""


def _ladder(terms: tuple[str, ...], **steps: str) -> Ladder:
    """Steps by name, each with its terms, parted by blanks."""
    return tuple(
        (name, tuple(sorted(terms.index(term) for term in told.split())))
        for name, told in steps.items()
    )


GEARS = TERMS.index("|v|"), TERMS.index("omega*sgn(v)")
DIFFERENTIAL = Ladders(
    _ladder(
        TERMS,
        gain="v",
        gains="v omega",
        product="v omega v*omega",
        slip="v omega v*omega v*|omega| v*omega^2 v*|v|",
    ),
    _ladder(
        TERMS,
        offset="v",
        centre="omega",
        gains="v omega",
        product="v omega v*omega",
        slip="v omega v*omega omega*|omega| omega^3 v^2*omega",
    ),
    _ladder(
        TERMS,
        gain="omega",
        gains="v omega",
        product="v omega v*omega",
        slip="v omega v*omega omega*|omega| omega^3 v^2*omega",
    ),
    (0, 1, 2),
    GEARS,
)
CAR = Ladders(
    _ladder(TERMS, gain="v"),
    # tyres that drift outwards, and a pose that is not over the rear axle
    _ladder(TERMS, drift="v^2*omega", centre="omega", gains="omega v^2*omega"),
    # what tyres lose at speed, and in tight turns; wheels that are not straight
    _ladder(
        TERMS,
        understeer="omega v^2*omega",
        saturates="omega v^2*omega omega*|omega|",
        draws="v omega v^2*omega",
        slip="v omega v*omega omega*|omega| omega^3 v^2*omega",
    ),
    (0, 1, 2),
    GEARS,
)
OMNI = Ladders(
    _ladder(
        OMNI_TERMS,
        gain="v",
        centre="v omega",
        gains="v lateral omega",
        slip="v lateral omega lateral*omega v*|v|",
    ),
    _ladder(
        OMNI_TERMS,
        gain="lateral",
        centre="lateral omega",
        gains="v lateral omega",
        slip="v lateral omega v*omega lateral*|lateral|",
    ),
    _ladder(
        OMNI_TERMS,
        gain="omega",
        gains="v lateral omega",
        slip="v lateral omega omega*|omega|",
    ),
    (0, 1, 2),
)
