"""The controller with guidance, put together as a user of the parts would."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

import kmpc_lite as kl
from kmpc_lite.control.guidance import Guide, tracking
from kmpc_lite.control.obstacles import circles_to_array


class GuidedController:
    """Steps of a controller whose reference comes from a guide; commands zero while the guide says hold."""

    def __init__(self, model: kl.KoopmanModel, problem: kl.NavigationProblem) -> None:
        self.guide = Guide(problem)
        outer = self

        class Inner(kl.Controller):
            def _reference(self, here: np.ndarray, target: np.ndarray, circles: np.ndarray) -> np.ndarray:
                return outer.guidance.states

        self.inner = Inner(model, tracking(problem))
        self.holding: list[bool] = []
        self.reachable: list[bool] = []
        self.refreshed: list[bool] = []

    def reset(self) -> None:
        self.guide.reset()
        self.inner.reset()

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[kl.Circle] | ArrayLike = ()) -> kl.Plan:
        pose = np.array(x, dtype=float)
        pose[2] -= 2 * np.pi * np.round(pose[2] / (2 * np.pi))
        self.guidance = self.guide.reference(pose, np.asarray(goal, dtype=float), circles_to_array(obstacles))
        self.holding.append(self.guidance.hold)
        self.reachable.append(self.guidance.reachable)
        self.refreshed.append(self.guidance.refreshed)
        if not self.guidance.hold:
            return self.inner.step(pose, goal, obstacles)
        self.inner.reset()
        n = self.inner.problem.horizon
        states, inputs = np.tile(pose, (n + 1, 1)), np.zeros((n, 2))
        return kl.Plan(inputs[0], states, inputs, kl.PlanStatus.SOLVED, np.inf, 0, {"total": 0.0}, "holding")
