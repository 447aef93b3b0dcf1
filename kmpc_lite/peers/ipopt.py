"""CasADi + IPOPT: the paper's NMPC (nominal model) and K-NMPC (learned model)."""

from __future__ import annotations

from collections.abc import Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.obstacles import Circle, circle_distances, circles_to_array
from kmpc_lite.control.plan import Plan, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.dictionary import INPUTS, STATES, Array
from kmpc_lite.errors import KmpcError, ProblemError
from kmpc_lite.model import KoopmanModel


def symbolic_step(model: KoopmanModel) -> Any:
    """Build the model's prediction as a CasADi function (x (3,), u (2,)) -> (3,): the model's own code on symbols."""
    import casadi

    x, u = casadi.SX.sym("x", STATES), casadi.SX.sym("u", INPUTS)
    pose, command = (np.array(casadi.vertsplit(v), dtype=object) for v in (x, u))
    following = model.advance(pose, model.dictionary.inputs(command))
    return casadi.Function("f", [x, u], [casadi.vertcat(*following)])


class IpoptController:
    """Nonlinear MPC with hard constraints, by multiple shooting in CasADi, solved by IPOPT every step.

    As in the paper: states and commands are the variables, obstacles are constraints on the distance of the
    centres, nothing is soft, the last solution, shifted, is the start. When IPOPT gives up, its last iterate is used,
    as the usual tutorials do; the plan's status then is FALLBACK.

    Parameters
    ----------
    model : KoopmanModel
        `nominal_unicycle` for the paper's NMPC, a learned model for its K-NMPC.
    problem : NavigationProblem, optional
        The paper's where not given.
    solver : str
        CasADi's name of the solver: ``ipopt`` or ``fatrop``.
    options : dict, optional
        CasADi's options of the solver, added to the quiet defaults.

    Raises
    ------
    KmpcError
        Where CasADi is not installed.
    """

    def __init__(
        self, model: KoopmanModel, problem: NavigationProblem | None = None, solver: str = "ipopt", options: dict[str, Any] | None = None
    ) -> None:
        try:
            import casadi
        except ImportError as error:
            raise KmpcError("this peer needs CasADi: pip install 'kmpc-lite[peers]'") from error
        if model.history:
            raise ProblemError("the IPOPT peer takes models without input history")
        self.model, self.problem = model, NavigationProblem() if problem is None else problem
        self._casadi, self._plugin, self._options = casadi, solver, options or {}
        self._step_function = symbolic_step(model)
        self._solver: Any = None
        self._obstacle_count = -1
        self.reset()

    def reset(self) -> None:
        """Forget the last solution."""
        self._states: Array | None = None
        self._inputs = np.zeros((self.problem.horizon, INPUTS))

    def _build(self, count: int) -> None:
        """Set up the nonlinear programme for a number of obstacles."""
        ca, problem, n = self._casadi, self.problem, self.problem.horizon
        q, r, q_terminal = problem.weights
        x, u = ca.SX.sym("X", STATES, n + 1), ca.SX.sym("U", INPUTS, n)
        x_init, goal, circles = ca.SX.sym("x0", STATES), ca.SX.sym("goal", STATES), ca.SX.sym("o", 5, count)
        cost, dynamics, distances = 0, [x[:, 0] - x_init], []
        for k in range(n):
            error = x[:, k] - goal
            cost += error.T @ ca.DM(q) @ error + u[:, k].T @ ca.DM(r) @ u[:, k]
            dynamics.append(x[:, k + 1] - self._step_function(x[:, k], u[:, k]))
        error = x[:, n] - goal
        cost += error.T @ ca.DM(q_terminal) @ error
        for k in range(1, n + 1):
            for i in range(count):
                offset = x[:2, k] - circles[:2, i] - k * problem.dt * circles[3:, i]
                distances.append(ca.sqrt(ca.sumsqr(offset)) - circles[2, i] - problem.robot_radius - problem.margin)
        variables = ca.vertcat(ca.vec(x), ca.vec(u))
        parameters = ca.vertcat(x_init, goal, ca.vec(circles))
        constraints = ca.vertcat(*dynamics, *distances)
        options: dict[str, Any] = {"print_time": False, "error_on_fail": False, **self._options}
        if self._plugin == "ipopt":
            options = {"ipopt.print_level": 0, "ipopt.sb": "yes", **options}
        self._solver = ca.nlpsol("peer", self._plugin, {"x": variables, "f": cost, "g": constraints, "p": parameters}, options)
        u_min, u_max, x_min, x_max = problem.bounds
        free = np.full(STATES, np.inf)
        self._lower = np.concatenate([-free, np.tile(x_min, n), np.tile(u_min, n)])
        self._upper = np.concatenate([free, np.tile(x_max, n), np.tile(u_max, n)])
        zeros = np.zeros(STATES * (n + 1))
        self._g_lower = np.concatenate([zeros, np.zeros(n * count)])
        self._g_upper = np.concatenate([zeros, np.full(n * count, np.inf)])
        self._obstacle_count = count

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[Circle] | ArrayLike = ()) -> Plan:
        """Plan from the measured pose (3,) to the goal (3,); see `Controller.step`."""
        pose, target, circles = np.asarray(x, dtype=float), np.asarray(goal, dtype=float).copy(), circles_to_array(obstacles)
        if len(circles) != self._obstacle_count:
            self._build(len(circles))
        n = self.problem.horizon
        start = perf_counter()
        target[2] = pose[2] + np.remainder(target[2] - pose[2] + np.pi, 2 * np.pi) - np.pi
        if self._states is None:
            self._states = np.tile(pose, (n + 1, 1))
        guess = np.concatenate([self._states.ravel(), self._inputs.ravel()])
        found = self._solver(
            x0=guess,
            p=np.concatenate([pose, target, circles.ravel()]),
            lbx=self._lower,
            ubx=self._upper,
            lbg=self._g_lower,
            ubg=self._g_upper,
        )
        solution = np.array(found["x"]).ravel()
        states, inputs = solution[: STATES * (n + 1)].reshape(n + 1, STATES), solution[STATES * (n + 1) :].reshape(n, INPUTS)
        elapsed = perf_counter() - start
        statistics = self._solver.stats()
        u_min, u_max, _, _ = self.problem.bounds
        command = np.clip(np.where(np.isfinite(inputs[0]), inputs[0], 0.0), u_min, u_max)
        usable = bool(np.isfinite(solution).all())
        self._states = np.vstack([states[1:], states[-1:]]) if usable else None
        self._inputs = np.vstack([inputs[1:], inputs[-1:]]) if usable else np.zeros((n, INPUTS))
        clearance = np.inf
        if len(circles) and usable:
            distances, _ = circle_distances(circles, states[:, :2], self.problem.dt * np.arange(n + 1))
            clearance = float(distances.min()) - self.problem.robot_radius
        return Plan(
            command,
            states,
            inputs,
            PlanStatus.SOLVED if statistics["success"] else PlanStatus.FALLBACK,
            clearance,
            int(statistics.get("iter_count", 0)),
            {"solve": elapsed, "total": elapsed},
            "" if statistics["success"] else str(statistics["return_status"]),
        )
