"""The controller and the guide as they come, with what the guidance said and remembers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

import kmpc_lite as kl
from kmpc_lite.control.kernels.records import things_of
from kmpc_lite.control.path.capabilities import Capabilities, capabilities
from kmpc_lite.control.path.guide import Guide
from kmpc_lite.control.path.situation import Guidance, GuideState, GuideTask


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


class GuideInUse:
    """A guide, its state, and what it knows of a robot."""

    def __init__(
        self,
        problem: kl.NavigationProblem,
        known: Capabilities | kl.KoopmanModel | None = None,
        **options: Any,
    ) -> None:
        if not isinstance(known, Capabilities):
            known = capabilities(known or kl.nominal_unicycle(problem.dt), problem)
        self.guide, self.state, self.known = Guide(problem, **options), GuideState(), known

    def reference(
        self, pose: np.ndarray, goal: np.ndarray, circles: np.ndarray, **more: Any
    ) -> Guidance:
        return self.guide.reference(
            self.state, self.known, GuideTask(pose, goal, things_of(circles), **more)
        )
