"""Drives of a robot that does exactly what it is commanded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import kmpc_lab
import kmpc_lite as kl

DT = 0.1
MODEL = kl.nominal_unicycle(DT)
PAPER: dict[str, Any] = {"guidance": False, "tightening": None}
"""Straight for the goal, no margin but the problem's."""
RADIUS = kl.NavigationProblem().robot_radius


class Drive:
    """A noise-free drive, looked at ten times a period."""

    def __init__(
        self,
        controller: kl.Controller,
        start: Sequence[float],
        goal: Sequence[float],
        circles: Sequence[kl.Circle] = (),
        periods: int = 100,
    ) -> None:
        plant = kmpc_lab.DifferentialDrive()
        x = np.array(start, dtype=float)
        self.states, self.plans, self.clearances = [x], [], []
        for k in range(periods):
            now = [
                kl.Circle(c.x + k * DT * c.vx, c.y + k * DT * c.vy, c.radius, c.vx, c.vy)
                for c in circles
            ]
            plan = controller.step(x, goal, now)
            for i, p in enumerate(plant.trace(x, plan.command, DT, 10), start=1):
                t = (k + i / 10) * DT
                self.clearances.append(
                    min(
                        (
                            np.hypot(p[0] - c.x - t * c.vx, p[1] - c.y - t * c.vy)
                            - c.radius
                            - RADIUS
                            for c in circles
                        ),
                        default=np.inf,
                    )
                )
            x = p
            self.states.append(x)
            self.plans.append(plan)
        self.path = np.array(self.states)
        self.clearance = min(self.clearances)
        self.end = self.path[-1]

    def distance(self, x: float, y: float) -> float:
        """From the end to a point [m]."""
        return float(np.hypot(self.end[0] - x, self.end[1] - y))
