"""Options of the margins: how far plans and commands stay away for what a model does not know."""

from __future__ import annotations

from dataclasses import dataclass

from kmpc_lite.option_fields import check, probability, radii


@dataclass(frozen=True, slots=True)
class MarginOptions:
    """How wide margins are."""

    risk: float = probability(0.05)
    """Probability of leaving the tube around a plan within its memory (8 periods) that margins are
    made for. A collision is far rarer: the robot would have to leave the tube towards an obstacle
    that the plan touches, and no later step could correct it."""
    headway: float = radii(0.4)
    """Least margin at the fastest speed [radii], in proportion less below it, and never more than
    the clearance of the path: a floor may begin to slip at any time, and a slip of 0.2 pushes a
    robot aside by half of what it drives in a period."""
    side_margin: float = radii(1 / 15)
    """Margin from the sides of the area [radii]: nothing is hit there, the robot must only not
    creep out."""
    step_risk: float = probability(1e-3)
    """Probability that the error of a single command exceeds what its margin allows for; a tenth of
    it with a model that was corrected while driving."""

    def __post_init__(self) -> None:
        check(self)
