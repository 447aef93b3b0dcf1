"""The study behind the solver's settings: what each costs and what it gives, on tuning drives.

Plans are judged by the commands that they hold: rolled out by the model, their objective with
penalties against that of a plan that was run to convergence from the same state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import RecordedDrive
from kmpc_lab.bench.measure import violation
from kmpc_lab.peers.paper import short_way
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.nmpc.choose_solver import DEFAULT_SOLVER, choose_solver
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import QPSolver
from kmpc_lite.control.options import ControllerOptions, OSQPOptions, SolverOptions
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array


@dataclass(frozen=True)
class Variant:
    """One change to what is in use."""

    name: str
    osqp: dict[str, Any]
    """Other values of `SolverOptions.real_time`."""
    slots: int | None = None
    slack_weights: tuple[float, float] | None = None


VARIANTS = (
    Variant("in use", {}),
    *(Variant(f"rho {rho:g}", {"rho": rho}) for rho in (0.2, 0.5, 2.0, 5.0)),
    *(Variant(f"OSQP's scaling, {n} x", {"scaling": n}) for n in (1, 3, 10)),
    *(Variant(f"at most {n} iterations", {"max_iter": n}) for n in (30, 100, 200)),
    *(Variant(f"tolerance {eps:g}", {"tolerance": eps}) for eps in (3e-3, 3e-4)),
    *(Variant(f"alpha {a:g}", {"alpha": a}) for a in (1.0, 1.6, 1.8)),
    *(Variant(f"check every {n}", {"check_termination": n}) for n in (5, 25)),
    Variant("adaptive rho", {"adaptive_rho": True}),
    *(Variant(f"{n} slots", {}, slots=n) for n in (2, 3, 4, 8)),
    *(
        Variant(f"slack {linear:g}, {quadratic:g}", {}, slack_weights=(linear, quadratic))
        for linear, quadratic in ((30.0, 1e3), (1e3, 1e3), (100.0, 1e4))
    ),
)


def settings_study(
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: Sequence[RecordedDrive],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Time and quality of every variant on the same states; they take turns drive by drive.

    Returns
    -------
    list of dict
        One for each variant: iterations of OSQP, time of its solve [ms], excess of the objective
        over the converged plan's, violation [mm].
    """
    rows: list[dict[str, list[float]]] = [
        {"iterations": [], "solve": [], "excess": [], "violation": []} for _ in VARIANTS
    ]
    best = Controller(
        model,
        problem,
        guidance=False,
        tightening=None,
        sqp_iterations=100,
        tolerance=1e-4,
        obstacle_slots=8,
    )
    controllers = [_controller(model, problem, variant) for variant in VARIANTS]
    for i, drive in enumerate(drives):
        best.reset()
        converged = [
            _judge(best.step(x, drive.goal, drive.circles).inputs, x, drive, model, problem)[0]
            for x in drive.states
        ]
        for (controller, counting), row in zip(controllers, rows, strict=True):
            controller.reset()
            for k, x in enumerate(drive.states):
                count = counting.iterations
                plan = controller.step(x, drive.goal, drive.circles)
                if k:
                    objective, inside = _judge(plan.inputs, x, drive, model, problem)
                    row["iterations"].append(counting.iterations - count)
                    row["solve"].append(1e3 * plan.timing.get("solve", 0.0))
                    row["excess"].append(objective / converged[k] - 1.0)
                    row["violation"].append(1e3 * inside)
        progress(i + 1, len(drives))
    return [
        {"name": v.name, **{key: _quantiles(values) for key, values in row.items()}}
        for v, row in zip(VARIANTS, rows, strict=True)
    ]


class _Counting:
    """A solver that counts the iterations of another."""

    def __init__(self, solver: QPSolver) -> None:
        self._solver, self.iterations = solver, 0

    def __getattr__(self, name: str) -> Any:
        return getattr(self._solver, name)

    def solve(self, *data: Array, **more: Any) -> Any:
        """Solve and count."""
        solution = self._solver.solve(*data, **more)
        self.iterations += solution.iterations
        return solution


def _controller(
    model: KoopmanModel, problem: NavigationProblem, variant: Variant
) -> tuple[Controller, _Counting]:
    """Controller with a variant's settings, and the counter of its iterations."""
    if variant.slack_weights is not None:
        problem = replace(problem, slack_weights=variant.slack_weights)
    slots = 5 if variant.slots is None else variant.slots
    real_time = replace(SolverOptions().real_time, **variant.osqp)
    made: list[_Counting] = []

    def counting(qp: NavigationQP, options: OSQPOptions) -> Any:
        made.append(_Counting(choose_solver(DEFAULT_SOLVER, qp, options)))
        return made[-1]

    controller = Controller(
        model,
        problem,
        guidance=False,
        tightening=None,
        obstacle_slots=slots,
        solver=counting,
        options=ControllerOptions(solver=SolverOptions(real_time=real_time)),
    )
    return controller, made[0]


def _judge(
    inputs: Array, x: Array, drive: RecordedDrive, model: KoopmanModel, problem: NavigationProblem
) -> tuple[float, float]:
    """Objective with penalties of what the commands do, and how deep they enter an obstacle [m]."""
    goal = short_way(drive.goal, x)
    states = model.rollout(x, inputs)
    inside = violation(states, drive.circles, problem)
    return problem.cost(states, inputs, goal) + float(problem.slack_weights[0]) * inside, inside


def _quantiles(values: Sequence[float]) -> dict[str, float]:
    return {f"p{p:g}": float(np.quantile(values, p / 100)) for p in (50, 90, 99)}


def format_settings(rows: Sequence[dict[str, Any]]) -> str:
    """Render the study as a table."""
    lines = [
        f"{'':<22}{'OSQP iterations':>20}{'solve [ms]':>22}"
        f"{'excess objective [%]':>26}{'violation [mm]':>18}",
        f"{'':<22}{'p50':>7}{'p90':>6}{'p99':>7}{'p50':>8}{'p90':>7}{'p99':>7}"
        f"{'p50':>10}{'p90':>8}{'p99':>8}{'p90':>9}{'p99':>9}",
    ]
    for r in rows:
        i, s, e, v = r["iterations"], r["solve"], r["excess"], r["violation"]
        lines.append(
            f"{r['name']:<22}{i['p50']:7.0f}{i['p90']:6.0f}{i['p99']:7.0f}"
            f"{s['p50']:8.3f}{s['p90']:7.3f}{s['p99']:7.3f}"
            f"{100 * e['p50']:10.3f}{100 * e['p90']:8.2f}{100 * e['p99']:8.2f}"
            f"{v['p90']:9.1f}{v['p99']:9.1f}"
        )
    return "\n".join(lines)
