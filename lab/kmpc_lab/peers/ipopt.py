"""CasADi + IPOPT: the paper's NMPC (nominal model) and K-NMPC (learned model), and its problem."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lite.control.limits import RateLimit
from kmpc_lite.control.plan import Plan, PlannedAround, PlanStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.control.world.shapes import Circle, circles_to_array
from kmpc_lite.errors import KmpcError, ProblemError
from kmpc_lite.geometry import wrap
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import INPUTS, STATES, Array

AREA: dict[str, Any] = {"x_min": (-2.0, -2.0, -np.inf), "x_max": (2.0, 2.0, np.inf)}
"""Fields of a problem whose robot stays within 2 m of the origin along both axes."""


def papers_problem() -> NavigationProblem:
    """Build the defaults, which are the paper's, with the paper's area."""
    return NavigationProblem(**AREA)


def check_weights(problem: NavigationProblem) -> NavigationProblem:
    """Give a problem that peers can solve; raises ProblemError for a weight that they lack."""
    if problem.change_weight.any():
        raise ProblemError("R_change: peers weigh no changes of commands; it must not be given")
    return problem


def short_way(goal: Array, pose: Array) -> Array:
    """Give a goal (3,) whose heading is within half a turn of a pose's (3,): costs count turns."""
    out = goal.copy()
    out[2] = float(pose[2]) + wrap(float(goal[2]) - float(pose[2]))
    return out


def symbolic_step(model: KoopmanModel) -> Any:
    """Build the prediction as a CasADi function (x (3,), u (2,)) -> (3,): our code on symbols."""
    import casadi

    x, u = casadi.SX.sym("x", STATES), casadi.SX.sym("u", INPUTS)
    pose, command = (np.array(casadi.vertsplit(v), dtype=object) for v in (x, u))
    following = model.advance(pose, model.dictionary.inputs(command))
    return casadi.Function("f", [x, u], [casadi.vertcat(*following)])


class IpoptController:
    """Nonlinear MPC with hard constraints: multiple shooting in CasADi, solved by IPOPT.

    As in the paper: states and commands are the variables, obstacles are constraints on the
    distance of the centres, nothing is soft, the last solution, shifted, is the start. When IPOPT
    gives up, its last iterate is used, as the usual tutorials do; the plan's status then is
    FALLBACK.

    Parameters
    ----------
    model : KoopmanModel
        `nominal_unicycle` for the paper's NMPC, a learned model for its K-NMPC.
    problem : NavigationProblem, optional
        The paper's if not given.
    solver : str
        CasADi's name of the solver: ``ipopt`` or ``fatrop``.
    options : dict, optional
        CasADi's options of the solver, added to the quiet defaults.

    Raises
    ------
    KmpcError
        If CasADi is not installed.
    ProblemError
        For a model with input history, and for a problem that limits the change of commands where
        the solver is fatrop.
    """

    def __init__(
        self,
        model: KoopmanModel,
        problem: NavigationProblem | None = None,
        solver: str = "ipopt",
        options: dict[str, Any] | None = None,
    ) -> None:
        try:
            import casadi
        except ImportError as error:
            raise KmpcError("this peer needs CasADi: pip install 'kmpc-lab[peers]'") from error
        if model.history:
            raise ProblemError("the IPOPT peer takes models without input history")
        self.model = model
        self.problem = papers_problem() if problem is None else check_weights(problem)
        if solver == "fatrop" and self.problem.limits_changes:
            raise ProblemError(
                "fatrop takes no limits on the change of commands, which tie stages together: "
                "du_max must be infinite"
            )
        self._rates = RateLimit(self.problem)
        self._casadi, self._plugin, self._options = casadi, solver, options or {}
        self._step_function = symbolic_step(model)
        self._solver: Any = None
        self._obstacle_count = -1
        self.reset()

    def reset(self) -> None:
        """Forget the last solution."""
        self._states: Array | None = None
        self._inputs = np.zeros((self.problem.horizon, INPUTS))
        self._last = np.zeros(INPUTS)

    def _command_limits(self, command: Any, before: Any) -> Iterator[tuple[Any, float, float]]:
        """Expressions of a command and the one before it, with their least and largest values."""
        problem = self.problem
        for i in np.flatnonzero(np.isfinite(problem.du_max)).tolist():
            most = float(problem.dt * problem.du_max[i])
            yield command[i] - before[i], -most, most
        if problem.limits_wheels:
            fastest = float(problem.max_wheel_speed)
            for half in (-0.5 * problem.track, 0.5 * problem.track):
                yield command[0] + half * command[1], -fastest, fastest

    def _build(self, count: int) -> None:
        """Set up the nonlinear programme for a number of obstacles.

        It is ordered stage by stage, as solvers that use this structure want it.
        """
        ca, problem, n = self._casadi, self.problem, self.problem.horizon
        q, r, q_terminal = (ca.DM(weight) for weight in problem.weights)
        u_min, u_max, x_min, x_max = problem.bounds
        x = [ca.SX.sym(f"x{k}", STATES) for k in range(n + 1)]
        u = [ca.SX.sym(f"u{k}", INPUTS) for k in range(n)]
        goal, circles = ca.SX.sym("goal", STATES), ca.SX.sym("o", 5, count)
        last = ca.SX.sym("last", INPUTS)
        cost, constraints, g_lower, g_upper = 0, [], [], []
        for k in range(n + 1):
            error = x[k] - goal
            if k < n:
                cost += error.T @ q @ error + u[k].T @ r @ u[k]
                constraints.append(x[k + 1] - self._step_function(x[k], u[k]))
                g_lower += [0.0] * STATES
                g_upper += [0.0] * STATES
                for expression, least, most in self._command_limits(u[k], u[k - 1] if k else last):
                    constraints.append(expression)
                    g_lower.append(least)
                    g_upper.append(most)
            else:
                cost += error.T @ q_terminal @ error
            for i in range(count if k else 0):
                offset = x[k][:2] - circles[:2, i] - k * problem.dt * circles[3:, i]
                constraints.append(
                    ca.sqrt(ca.sumsqr(offset))
                    - circles[2, i]
                    - problem.robot_radius
                    - problem.margin
                )
                g_lower.append(0.0)
                g_upper.append(np.inf)
        options: dict[str, Any] = {"print_time": False, "error_on_fail": False}
        if self._plugin == "ipopt":
            options |= {"ipopt.print_level": 0, "ipopt.sb": "yes"}
        elif self._plugin == "fatrop":
            equality = [bool(bound == 0.0) for bound in g_upper]
            options |= {
                "structure_detection": "auto",
                "equality": equality,
                "expand": True,
                "fatrop.print_level": 0,
            }
        self._solver = ca.nlpsol(
            "peer",
            self._plugin,
            {
                "x": ca.vertcat(*[v for pair in zip(x, u, strict=False) for v in pair], x[n]),
                "f": cost,
                "g": ca.vertcat(*constraints),
                "p": ca.vertcat(goal, ca.vec(circles), last),
            },
            options | self._options,
        )
        self._lower = np.concatenate([np.tile(np.concatenate([x_min, u_min]), n), x_min])
        self._upper = np.concatenate([np.tile(np.concatenate([x_max, u_max]), n), x_max])
        self._g_lower, self._g_upper = np.array(g_lower), np.array(g_upper)
        self._obstacle_count = count

    def step(
        self, x: ArrayLike, goal: ArrayLike, obstacles: Sequence[Circle] | ArrayLike = ()
    ) -> Plan:
        """Plan from the measured pose (3,) to the goal (3,); see `Controller.step`."""
        pose = np.asarray(x, dtype=float)
        target = np.asarray(goal, dtype=float)
        circles = circles_to_array(obstacles)
        if len(circles) != self._obstacle_count:
            self._build(len(circles))
        n = self.problem.horizon
        start = perf_counter()
        target = short_way(target, pose)
        if self._states is None:
            self._states = np.tile(pose, (n + 1, 1))
        guess = np.concatenate(
            [np.hstack([self._states[:-1], self._inputs]).ravel(), self._states[-1]]
        )
        guess[:STATES] = self._lower[:STATES] = self._upper[:STATES] = pose
        found = self._solver(
            x0=guess,
            p=np.concatenate([target, circles.ravel(), self._last]),
            lbx=self._lower,
            ubx=self._upper,
            lbg=self._g_lower,
            ubg=self._g_upper,
        )
        solution = np.array(found["x"]).ravel()
        stages = solution[: (STATES + INPUTS) * n].reshape(n, STATES + INPUTS)
        states = np.vstack([stages[:, :STATES], solution[-STATES:]])
        inputs = stages[:, STATES:].copy()
        elapsed = perf_counter() - start
        statistics = self._solver.stats()
        command = self.problem.within_bounds(np.where(np.isfinite(inputs[0]), inputs[0], 0.0))
        if self._rates.active:
            command = np.clip(command, *self._rates.first(self._last))
        self._last = command.copy()
        usable = bool(np.isfinite(solution).all())
        self._states = np.vstack([states[1:], states[-1:]]) if usable else None
        self._inputs = np.vstack([inputs[1:], inputs[-1:]]) if usable else np.zeros((n, INPUTS))
        seen = circles if usable else circles[:0]
        return Plan(
            command,
            states,
            inputs,
            PlanStatus.SOLVED if statistics["success"] else PlanStatus.FALLBACK,
            int(statistics.get("iter_count", 0)),
            {"total": elapsed},
            "" if statistics["success"] else str(statistics["return_status"]),
            around=PlannedAround(seen.copy(), None, self.problem.robot_radius, self.problem.dt),
        )
