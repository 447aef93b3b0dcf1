"""The study behind the solver's settings: what each costs and what it gives, on tuning drives.

Plans are judged by the commands that they hold: rolled out by the model, their objective with
penalties against that of a plan that was run to convergence from the same state.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np
import scipy.sparse as sp

from kmpc_lite.bench.measure import Drive, violation
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.nmpc import sqp
from kmpc_lite.control.nmpc.osqp_workspace import OSQPWorkspace, QPStatus
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array


@dataclass(frozen=True)
class Variant:
    """One change to what is in use."""

    name: str
    osqp: dict[str, Any]
    """Settings of OSQP instead of `sqp.REAL_TIME`'s."""
    slots: int | None = None
    slack_weights: tuple[float, float] | None = None


VARIANTS = (
    Variant("in use", {}),
    *(Variant(f"rho {rho:g}", {"rho": rho}) for rho in (0.2, 0.5, 2.0, 5.0)),
    *(Variant(f"OSQP's scaling, {n} x", {"scaling": n}) for n in (1, 3, 10)),
    *(Variant(f"at most {n} iterations", {"max_iter": n}) for n in (30, 100, 200)),
    *(Variant(f"tolerance {eps:g}", {"eps_abs": eps, "eps_rel": eps}) for eps in (3e-3, 3e-4)),
    *(Variant(f"alpha {a:g}", {"alpha": a}) for a in (1.0, 1.6, 1.8)),
    *(Variant(f"check every {n}", {"check_termination": n}) for n in (5, 25)),
    Variant("adaptive rho", {"adaptive_rho": 1}),
    *(Variant(f"{n} slots", {}, slots=n) for n in (2, 3, 4, 8)),
    *(
        Variant(f"slack {linear:g}, {quadratic:g}", {}, slack_weights=(linear, quadratic))
        for linear, quadratic in ((30.0, 1e3), (1e3, 1e3), (100.0, 1e4))
    ),
)


def settings_study(
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: Sequence[Drive],
    variants: Sequence[Variant] = VARIANTS,
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
        {"iterations": [], "solve": [], "excess": [], "violation": []} for _ in variants
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
    controllers = [_controller(model, problem, variant) for variant in variants]
    for i, drive in enumerate(drives):
        best.reset()
        converged = [
            _judge(best.step(x, drive.goal, drive.circles).inputs, x, drive, model, problem)[0]
            for x in drive.states
        ]
        for controller, row in zip(controllers, rows, strict=True):
            controller.reset()
            for k, x in enumerate(drive.states):
                count = controller.iterations
                plan = controller.step(x, drive.goal, drive.circles)
                if k:
                    objective, inside = _judge(plan.inputs, x, drive, model, problem)
                    row["iterations"].append(controller.iterations - count)
                    row["solve"].append(1e3 * plan.timing.get("solve", 0.0))
                    row["excess"].append(objective / converged[k] - 1.0)
                    row["violation"].append(1e3 * inside)
        progress(i + 1, len(drives))
    return [
        {"name": v.name, **{key: _quantiles(values) for key, values in row.items()}}
        for v, row in zip(variants, rows, strict=True)
    ]


class _Counting(Controller):
    """Counts the iterations of OSQP."""

    iterations = 0


def _controller(model: KoopmanModel, problem: NavigationProblem, variant: Variant) -> _Counting:
    kept, sqp.REAL_TIME = sqp.REAL_TIME, {**sqp.REAL_TIME, **variant.osqp}
    try:
        asked = (
            problem
            if variant.slack_weights is None
            else replace(problem, slack_weights=variant.slack_weights)
        )
        more = {} if variant.slots is None else {"obstacle_slots": variant.slots}
        controller = _Counting(model, asked, guidance=False, tightening=None, **more)  # type: ignore[arg-type]
    finally:
        sqp.REAL_TIME = kept
    solve = controller._sqp.workspace.solve

    def counted(*data: Array) -> Any:
        solution = solve(*data)
        controller.iterations += solution.iterations
        return solution

    controller._sqp.workspace.solve = counted  # type: ignore[method-assign,assignment]
    return controller


def _judge(
    inputs: Array, x: Array, drive: Drive, model: KoopmanModel, problem: NavigationProblem
) -> tuple[float, float]:
    """Objective with penalties of what the commands do, and how deep they enter an obstacle [m]."""
    goal = drive.goal.copy()
    goal[2] = x[2] + np.remainder(goal[2] - x[2] + np.pi, 2 * np.pi) - np.pi
    states = model.rollout(x, inputs)
    inside = violation(states, drive.circles, problem)
    return problem.cost(states, inputs, goal) + float(problem.slack_weights[0]) * inside, inside


def _quantiles(values: Sequence[float]) -> dict[str, float]:
    return {f"p{p:g}": float(np.quantile(values, p / 100)) for p in (50, 90, 99)}


def record_qps(
    model: KoopmanModel, problem: NavigationProblem, drives: Sequence[Drive]
) -> list[tuple[Any, ...]]:
    """QPs (P, q, A, lower, upper) that a plain controller meets, for other solvers to try."""
    controller = Controller(model, problem, guidance=False, tightening=None)
    qps: list[tuple[Any, ...]] = []
    workspace, qp = controller._sqp.workspace, controller._sqp.qp
    solve = workspace.solve

    def kept(q: Array, lower: Array, upper: Array, a_x: Array, x: Array, y: Array) -> Any:
        a = qp.A.copy()
        a.data[:] = a_x
        qps.append((qp.P.copy(), q.copy(), a, lower.copy(), np.minimum(upper, 1e20)))
        return solve(q, lower, upper, a_x, x, y)

    workspace.solve = kept  # type: ignore[method-assign,assignment]
    for drive in drives:
        controller.reset()
        for x in drive.states:
            controller.step(x, drive.goal, drive.circles)
    return qps


def solver_study(
    qps: Sequence[tuple[Any, ...]], problem: NavigationProblem
) -> list[dict[str, Any]]:
    """Solve recorded QPs cold with every solver that qpsolvers finds installed.

    Sparse solvers get the QP as it is, dense ones get it condensed to the commands.

    OSQP's row is our workspace with no warm start. The error is the largest difference of the first
    command to OSQP's at a tolerance of 1e-9.
    """
    import qpsolvers

    n = problem.horizon
    first = 3 * n
    exact = []
    for p, q, a, lower, upper in qps:
        found = OSQPWorkspace(
            p, q, a, lower, upper, eps_abs=1e-9, eps_rel=1e-9, max_iter=50000
        ).solve(q, lower, upper, a.data, np.zeros(len(q)), np.zeros(len(lower)))
        exact.append(found.x[first : first + 2] if found.status is QPStatus.SOLVED else None)
    rows = []
    workspace = OSQPWorkspace(*qps[0], **sqp.REAL_TIME)
    times, errors = [], []
    for (_, q, a, lower, upper), true in zip(qps, exact, strict=True):
        begin = perf_counter()
        x = workspace.solve(q, lower, upper, a.data, np.zeros(len(q)), np.zeros(len(lower))).x
        times.append(1e3 * (perf_counter() - begin))
        if true is not None:
            errors.append(float(np.abs(x[first : first + 2] - true).max()))
    rows.append(
        {
            "name": "osqp, ours, cold",
            "form": "sparse",
            "ms": _quantiles(times),
            "error": _quantiles(errors),
            "failed": 0,
        }
    )
    for name in qpsolvers.available_solvers:
        for form in ("sparse", "condensed"):
            if (
                form == "sparse"
                and name not in qpsolvers.sparse_solvers
                or form == "condensed"
                and name not in qpsolvers.dense_solvers
            ):
                continue
            times, errors, failed = [], [], 0
            for (p, q, a, lower, upper), true in zip(qps, exact, strict=True):
                full = sp.csc_matrix(p + sp.triu(p, 1).T)
                equal = 3 * n
                e, b = a[:equal], lower[:equal]
                g = sp.vstack([a[equal:], -a[equal:]], format="csc")
                h = np.concatenate([upper[equal:], -lower[equal:]])
                used = np.abs(h) < 1e3
                g, h = g[used], h[used]
                if form == "condensed":
                    states = sp.csc_matrix(e[:, :first])
                    free = -np.linalg.solve(states.toarray(), e[:, first:].toarray())
                    fixed = np.linalg.solve(states.toarray(), b)
                    lift = np.vstack([free, np.eye(full.shape[0] - first)])
                    offset = np.concatenate([fixed, np.zeros(full.shape[0] - first)])
                    dense_p, dense_q = lift.T @ (full @ lift), lift.T @ (q + full @ offset)
                    dense_p += 1e-9 * np.eye(len(dense_p))
                    task = qpsolvers.Problem(dense_p, dense_q, g @ lift, h - g @ offset)
                    place = 0
                else:
                    task, place = qpsolvers.Problem(full, q, g, h, sp.csc_matrix(e), b), first
                begin = perf_counter()
                solution = qpsolvers.solve_problem(task, solver=name)
                times.append(1e3 * (perf_counter() - begin))
                if not solution.found or solution.x is None:
                    failed += 1
                elif true is not None:
                    errors.append(float(np.abs(solution.x[place : place + 2] - true).max()))
            rows.append(
                {
                    "name": name,
                    "form": form,
                    "ms": _quantiles(times),
                    "error": _quantiles(errors or [np.nan]),
                    "failed": failed,
                }
            )
    return rows


def format_settings(rows: Sequence[dict[str, Any]], solvers: Sequence[dict[str, Any]]) -> str:
    """Render both studies as tables."""
    lines = [
        f"{'':<22}{'OSQP iterations':>20}{'solve [ms]':>22}"
        f"{'excess objective [%]':>26}{'violation [mm]':>18}"
    ]
    lines.append(
        f"{'':<22}{'p50':>7}{'p90':>6}{'p99':>7}{'p50':>8}{'p90':>7}{'p99':>7}{'p50':>10}{'p90':>8}{'p99':>8}{'p90':>9}{'p99':>9}"
    )
    for r in rows:
        i, s, e, v = r["iterations"], r["solve"], r["excess"], r["violation"]
        lines.append(
            f"{r['name']:<22}{i['p50']:7.0f}{i['p90']:6.0f}{i['p99']:7.0f}{s['p50']:8.3f}{s['p90']:7.3f}{s['p99']:7.3f}"
            f"{100 * e['p50']:10.3f}{100 * e['p90']:8.2f}{100 * e['p99']:8.2f}"
            f"{v['p90']:9.1f}{v['p99']:9.1f}"
        )
    lines += [
        "",
        f"{'cold solves':<22}{'form':<12}{'p50':>8}{'p99':>8} [ms]  error of the first command "
        "p50, p99; failed",
    ]
    for r in solvers:
        t, e = r["ms"], r["error"]
        lines.append(
            f"{r['name']:<22}{r['form']:<12}{t['p50']:8.3f}{t['p99']:8.3f}       {e['p50']:.1e}, "
            f"{e['p99']:.1e}; {r['failed']}"
        )
    return "\n".join(lines)
