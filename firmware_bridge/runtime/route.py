"""Goals one after the other: the next one is given when the last one is held."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

Pose = tuple[float, float, float]


class Route:
    """Knows to which goal a robot drives.

    `goals`: poses (3,) [m, m, rad], at least one. `loop`: whether the first goal follows the last
    one, for ever. `clicked`: whether goals come while it drives: `goals` only say where maps begin,
    and it is idle.

    Examples
    --------
    >>> route = Route([(1.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    >>> route.hold()
    >>> route.goal, route.leg, route.done
    ((0.0, 0.0, 0.0), (2, 2), False)
    """

    def __init__(self, goals: Sequence[Pose], loop: bool = False, clicked: bool = False) -> None:
        self.goals, self.loop, self.clicked = tuple(goals), loop, clicked
        self.idle = clicked
        """Whether no goal is given yet."""
        self.held = 0
        """How many goals were held so far, all rounds counted."""

    def hold(self) -> None:
        """Note that the present goal is held: the next one becomes the goal."""
        self.held += 1

    def go(self, goal: Pose) -> None:
        """Take a goal instead of all others."""
        self.goals, self.loop, self.idle, self.held = (goal,), False, False, 0

    @property
    def rounds(self) -> int:
        """How often all goals were held."""
        return self.held // len(self.goals)

    @property
    def done(self) -> bool:
        """Whether the last goal is held; never of a loop."""
        return self.rounds > 0 and not self.loop

    @property
    def is_last(self) -> bool:
        """Whether the route ends with the present goal."""
        return not self.loop and self.held >= len(self.goals) - 1

    @property
    def leg(self) -> tuple[int, int]:
        """Number of the present goal, from 1, and of all goals."""
        count = len(self.goals)
        return (count if self.done else self.held % count + 1), count

    @property
    def goal(self) -> Pose:
        """The present goal; the last one when all are held."""
        return self.goals[self.leg[0] - 1]

    @property
    def words(self) -> str:
        """Which goal of how many, for people; empty for a single goal."""
        number, count = self.leg
        lap = f", round {self.rounds + 1}" if self.loop else ""
        return f"goal {number} of {count}{lap}" if count > 1 else ""

    def report(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        number, count = self.leg
        return {"goal": number, "of": count, "held": self.held}
