"""The controller as it comes, with a record of what the guidance said."""

from __future__ import annotations

from collections.abc import Sequence

from numpy.typing import ArrayLike

import kmpc_lite as kl


class GuidedController(kl.Controller):
    """Remembers of every step whether the robot held, and whether there was a way."""

    def __init__(self, model: kl.KoopmanModel, problem: kl.NavigationProblem) -> None:
        super().__init__(model, problem)
        self.holding: list[bool] = []
        self.reachable: list[bool] = []

    def step(
        self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[kl.Circle] | ArrayLike = ()
    ) -> kl.Plan:
        plan = super().step(x, goal, obstacles)
        self.holding.append(plan.holding)
        self.reachable.append(plan.reachable)
        return plan
