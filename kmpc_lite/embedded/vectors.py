"""Test vectors: what the controller in Python answers, step by step, on a drive past circles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import PlanStatus
from kmpc_lite.types import Array

STEPS = 80
STATUSES = (PlanStatus.SOLVED, PlanStatus.FEASIBLE, PlanStatus.FALLBACK, PlanStatus.STOPPED)
"""In the order of `enum kmpc_status`."""


class Vector(NamedTuple):
    """What comes in, in metres and seconds, and the answer."""

    pose: Array
    goal: Array
    circles: Array
    command: Array
    status: int


def recorded_vectors(controller: Controller, steps: int = STEPS) -> list[Vector]:
    """Drive a controller past two circles, one of which moves, and two steps that are refused.

    Sizes follow the robot: circles are as large as it is, and lie on the right of its way, which
    turns left and is as long as it drives in a few seconds. (Before it they would make a plan hang
    between two sides, where the last bit of a number decides.)
    """
    problem, model = controller.problem, controller.model
    speed, radius = float(max(problem.u_max[0], -problem.u_min[0])), problem.robot_radius
    way = max(0.35 * steps * problem.dt * speed, 12.0 * radius)
    low, high = problem.bounds[2][:2], problem.bounds[3][:2]
    bounded = np.isfinite(low) & np.isfinite(high)
    low, high = np.where(bounded, low, 0.0), np.where(bounded, high, 0.0)
    middle, room = 0.5 * (low + high), np.where(bounded, 0.35 * (high - low), np.inf)
    half = np.minimum(0.5 * way, room)
    start, goal = np.array([*(middle - half), 0.3]), np.array([*(middle + half), 0.0])
    pose, past = start, np.zeros((model.history, 2))
    vectors = []
    controller.reset()
    for k in range(steps):
        moving = middle + (0.3 * half[0], -half[1] + 0.1 * speed * problem.dt * k)
        circles = np.array(
            [
                [*(middle - 0.35 * half + (1.5 * radius, -1.5 * radius)), radius, 0.0, 0.0],
                [*moving, radius, 0.0, 0.1 * speed],
            ]
        )
        told = np.full(3, np.nan) if k in (20, 21) else pose
        plan = controller.step(told, goal, circles)
        status = STATUSES.index(plan.status)
        vectors.append(Vector(told, goal, circles, plan.command, status))
        pose = model.predict(pose, plan.command, past)
        if model.history:
            past = np.concatenate([past[1:], plan.command[None]])
    controller.reset()
    return vectors
