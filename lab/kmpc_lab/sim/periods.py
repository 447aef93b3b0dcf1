"""The loop that every simulated drive goes through: plan from the pose, move, look, go on."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

from kmpc_lite.control.plan import Plan
from kmpc_lite.types import Array


class Period(NamedTuple):
    """What happened in one period."""

    number: int
    """From 0."""
    plan: Plan
    """Whose command was driven."""
    poses: Array
    """(S, 3) true poses during the period, without the first; the next one begins at the last."""


def periods(
    step: Callable[[Array, int], Plan],
    move: Callable[[Array, Array], Array],
    start: Array,
    most: int,
) -> Iterator[Period]:
    """Drive period by period, until whoever looks on has seen enough.

    `step`: plans from the true pose (3,) in a period, by its number; what is measured of the pose,
    and seen of the obstacles, is its own affair. `move`: gives the poses (S, 3) to which a command
    (2,) leads from a pose (3,). `start`: where the robot stands (3,). `most`: periods after which
    the drive ends.

    Examples
    --------
    >>> from kmpc_lite import Controller, nominal_unicycle
    >>> from kmpc_lab.sim.plants.robots import DifferentialDrive
    >>> import numpy as np
    >>> robot, controller = DifferentialDrive(), Controller(nominal_unicycle(0.1))
    >>> for number, plan, poses in periods(
    ...     lambda pose, number: controller.step(pose, goal=(1.0, 0.0, 0.0)),
    ...     lambda pose, command: robot.trace(pose, command, 0.1, 4),
    ...     np.zeros(3),
    ...     most=100,
    ... ):
    ...     if plan.holding:
    ...         break
    >>> bool(np.hypot(*(poses[-1, :2] - (1.0, 0.0))) < 0.02)
    True
    """
    pose = start
    for number in range(most):
        plan = step(pose, number)
        poses = move(pose, plan.command)
        pose = poses[-1]
        yield Period(number, plan, poses)
