"""Scenes for the guide, and drives along what it says."""

from __future__ import annotations

import numpy as np
from guided import GuidedController

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.peers.paper import AREA
from kmpc_lite.control.options import GuidanceOptions, lengths_from_radii
from kmpc_lite.control.world.circles import circles_to_array

DT = 0.1
PROBLEM = kl.NavigationProblem(**AREA, margin=0.05)
KEEP = PROBLEM.robot_radius + PROBLEM.margin
OPTIONS = lengths_from_radii(GuidanceOptions(), PROBLEM.robot_radius)
NO_CIRCLES = np.empty((0, 5))


def pose(*values: float) -> np.ndarray:
    return np.array(values, dtype=float)


def circles(*rows: tuple[float, ...]) -> np.ndarray:
    return circles_to_array([kl.Circle(*row) for row in rows])


def ring(radius: float, count: int = 16, size: float = 0.2) -> np.ndarray:
    angle = np.linspace(0.0, 2 * np.pi, count, endpoint=False)
    return np.column_stack(
        [radius * np.cos(angle), radius * np.sin(angle), np.full(count, size), np.zeros((count, 2))]
    )


def drive(
    controller: GuidedController,
    start: np.ndarray,
    goal: np.ndarray,
    scene: np.ndarray,
    periods: int,
    slip: float = 0.0,
    opens: int = 10**9,
) -> tuple[np.ndarray, np.ndarray]:
    """States (T + 1, 3), and gaps between robot and obstacles at ten moments a period (10 T,)."""
    plant, x, states, gaps = kmpc_lab.DifferentialDrive(slip, seed=1), start, [start], []
    for k in range(periods):
        now = scene if k < opens else scene[3:]
        seen = now.copy()
        seen[:, :2] += k * DT * now[:, 3:]
        plan = controller.step(x, goal, seen)
        trace = plant.trace(x, plan.command, DT, 10)
        for i, p in enumerate(trace, start=1):
            where = seen[:, :2] + i * DT / 10 * seen[:, 3:]
            gaps.append(
                (np.hypot(*(where - p[:2]).T) - seen[:, 2]).min(initial=np.inf)
                - PROBLEM.robot_radius
            )
        x = trace[-1]
        states.append(x)
    return np.array(states), np.array(gaps)
