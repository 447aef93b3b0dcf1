"""acados SQP_RTI with HPIPM: the same problem with the same soft obstacles, as generated C."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.peers.acados_solver import build_solver
from kmpc_lab.peers.acados_wheel import default_folder, prepare, why_not
from kmpc_lab.peers.paper import check_weights, papers_problem, short_way
from kmpc_lite.control.plan import Plan, PlannedAround, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.circles import Circle, circles_to_array
from kmpc_lite.errors import KmpcError, ProblemError
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, Array

FAR_AWAY = (1e3, 1e3, 0.0, 0.0, 0.0)


class AcadosController:
    """One SQP_RTI step of acados per period, obstacles soft with the same penalties as ours.

    `model`: its prediction becomes the discrete dynamics. `problem`: the paper's if not given.
    `obstacles`: how many circles the generated solver has room for; fewer are filled up with ones
    far away. Raises KmpcError if acados cannot be used; says why. Raises ProblemError for a problem
    that limits the change of commands.
    """

    def __init__(
        self, model: KoopmanModel, problem: NavigationProblem | None = None, obstacles: int = 4
    ) -> None:
        if problem is not None and problem.limits_changes:
            raise ProblemError(
                "the acados peer knows no limits on the change of commands: du_max must be infinite"
            )
        if problem is not None and problem.limits_wheels:
            raise ProblemError("the acados peer knows no wheels: max_wheel_speed must be infinite")
        reason = why_not()
        if reason:
            raise KmpcError(f"acados: {reason}")
        self.problem = papers_problem() if problem is None else check_weights(problem)
        self.obstacles = obstacles
        prepare(default_folder())
        self._work = tempfile.TemporaryDirectory(prefix="kmpc_acados_")
        self._solver = build_solver(model, self.problem, obstacles, Path(self._work.name))
        self.reset()

    def reset(self) -> None:
        """Forget the last solution."""
        self._plan: tuple[Array, Array] | None = None
        self._known = b""

    def step(
        self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[Circle] | ArrayLike = ()
    ) -> Plan:
        """Plan from the measured pose (3,) to the goal (3,); see `Controller.step`."""
        pose = np.asarray(x, dtype=float)
        target = np.asarray(goal, dtype=float)
        circles = circles_to_array(obstacles)
        if len(circles) > self.obstacles:
            raise ValueError(
                f"obstacles: the solver was generated for {self.obstacles}, got {len(circles)}"
            )
        n, solver = self.problem.horizon, self._solver
        start = perf_counter()
        target = short_way(target, pose)
        self._set(pose, target, circles)
        prepared = perf_counter()
        status = solver.solve()
        solved = perf_counter()
        states = np.array([solver.get(k, "x") for k in range(n + 1)])
        inputs = np.array([solver.get(k, "u") for k in range(n)])
        usable = bool(np.isfinite(states).all() and np.isfinite(inputs).all())
        self._plan = (
            (np.vstack([states[1:], states[-1:]]), np.vstack([inputs[1:], inputs[-1:]]))
            if usable
            else None
        )
        end = perf_counter()
        u_min, u_max, _, _ = self.problem.bounds
        command = np.clip(np.where(np.isfinite(inputs[0]), inputs[0], 0.0), u_min, u_max)
        seen = circles if usable else circles[:0]
        good = status in (0, 2) and usable
        return Plan(
            command,
            states,
            inputs,
            PlanStatus.SOLVED if good else PlanStatus.FALLBACK,
            1,
            # setting and reading through Python is not acados' own time: it is listed apart
            {
                "set": prepared - start,
                "solve": solved - prepared,
                "read": end - solved,
                "total": end - start,
            },
            "" if good else f"acados status {status}",
            around=PlannedAround(seen.copy(), None, self.problem.robot_radius, self.problem.dt),
        )

    def _set(self, pose: Array, target: Array, circles: Array) -> None:
        """Tell the solver a pose (3,), a goal (3,), circles (M, 5), and where to start from."""
        n, dt, solver = self.problem.horizon, self.problem.dt, self._solver
        slots = np.array([*circles, *[FAR_AWAY] * (self.obstacles - len(circles))])
        states, inputs = self._plan or (np.tile(pose, (n + 1, 1)), np.zeros((n, INPUTS)))
        known = target.tobytes() + slots.tobytes()
        if known != self._known:
            # every call into C costs: only what is new is set
            self._known = known
            y_ref = np.concatenate([target, np.zeros(INPUTS)])
            for k in range(n + 1):
                centres = slots[:, :2] + k * dt * slots[:, 3:]
                solver.set(k, "p", np.hstack([centres, slots[:, 2:3]]).ravel())
                solver.set(k, "yref", y_ref if k < n else target)
        for k in range(n + 1):
            solver.set(k, "x", states[k])
            if k < n:
                solver.set(k, "u", inputs[k])
        solver.set(0, "lbx", pose)
        solver.set(0, "ubx", pose)
