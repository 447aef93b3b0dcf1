"""From a pass's task and its linearisation to the numbers of its QP."""

from __future__ import annotations

import math

import numpy as np

from kmpc_lite.control.footprint import places_of
from kmpc_lite.control.kernels import library
from kmpc_lite.control.kernels.fill import Around, Iterate, KeepOut, PlanMargins
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.task import Task
from kmpc_lite.model.arguments import speeds
from kmpc_lite.model.linearization import Linearization
from kmpc_lite.types import Array


def keep_out(problem: NavigationProblem, slots: int) -> KeepOut:
    """What a robot's outline stays out of: obstacles, and the outside of the area.

    Obstacles are grown by the radius of the outline's circles and the problem's margin.
    """
    _, _, x_min, x_max = problem.bounds
    sides = [
        (axis, sign, sign * bound)
        for axis in (0, 1)
        for sign, bound in ((1.0, x_min[axis]), (-1.0, x_max[axis]))
        if np.isfinite(bound)
    ]
    normals = np.zeros((len(sides), 2))
    for row, (axis, sign, _) in zip(normals, sides, strict=True):
        row[axis] = sign
    return KeepOut(
        distance=float(problem.body_radius + problem.margin),
        dt=problem.dt,
        range=math.inf if problem.sensor_range is None else problem.sensor_range,
        side_normals=normals,
        side_offsets=np.array([offset for _, _, offset in sides]),
        directions=2 if problem.footprint is None else 3,
        slots=slots,
    )


class FillQP:
    """Writes the QP of a pass: dynamics, half-planes and cost, around the robot.

    `problem`: bounds, outline, margin. `slots`: half-planes per stage.
    """

    def __init__(self, problem: NavigationProblem, slots: int) -> None:
        self.keep_out = keep_out(problem, slots)
        self._footprint = problem.footprint
        circles = 1 if problem.footprint is None else len(problem.footprint.circles)
        count = circles * problem.horizon
        self._nothing = np.empty((count, 0)), np.empty((count, 0, self.keep_out.directions))

    def __call__(
        self, qp: NavigationQP, task: Task, lin: Linearization, states: Array, inputs: Array
    ) -> None:
        """Write the QP at a guess (N + 1, 3) and (N, m), linearised there."""
        points = places_of(self._footprint, states[1:])
        gaps, away = self._nothing
        if task.around.nearby is not None:
            body = None if self._footprint is None else (self._footprint, states[1:])
            gaps, away = task.around.nearby.measure(points, body)
        margins, felt = None, task.felt
        if task.margins is not None and felt is not None:
            path = task.path_clearance
            margins = PlanMargins(
                noise=felt.tube,
                widest=felt.widest,
                far_clearance=task.margins.far_clearance,
                side_margin=task.margins.side_margin,
                path_clearance=(
                    np.full(len(inputs), path) if isinstance(path, float) else np.ravel(path)
                ),
            )
        plan = Iterate(states, inputs, task.reference, speeds(inputs), task.to_goal)
        around = Around(task.around.things, points, gaps, away)
        library.fill(self.keep_out, margins, qp.numbers, lin, plan, around)
        qp.P.data[qp.turn_places] = qp.numbers.turn
