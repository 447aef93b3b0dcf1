"""Step times by horizon and by number of obstacles."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import record
from kmpc_lab.studies.contenders import FULL_STEP
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel


def scaling(
    model: KoopmanModel,
    seed: int,
    drives: int,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[dict[str, Any]]:
    """Median and p99 of a full step, by horizon and by number of obstacles.

    Horizons are measured with 4 obstacles, obstacles with N = 20; settings take turns drive by
    drive.
    """
    cases = [(n, 4) for n in (10, 20, 50, 100, 200)] + [(20, m) for m in (1, 16, 64)]
    problems = [
        NavigationProblem(horizon=n, x_min=(-8.0, -8.0, -np.inf), x_max=(8.0, 8.0, np.inf))
        for n, _ in cases
    ]
    recorded = [
        record(model, p, drives, 40, m, seed, FULL_STEP)
        for p, (_, m) in zip(problems, cases, strict=True)
    ]
    controllers = [FULL_STEP.make(model, p) for p in problems]
    times: list[list[float]] = [[] for _ in cases]
    for i in range(drives):
        for j, controller in enumerate(controllers):
            controller.reset()
            drive = recorded[j][i]
            plans = [controller.step(x, drive.goal, drive.circles) for x in drive.states]
            times[j] += [plan.timing["total"] for plan in plans[1:]]
        progress(i + 1, drives)
    return [
        {
            "horizon": n,
            "obstacles": m,
            "ms": {"p50": 1e3 * float(np.median(t)), "p99": 1e3 * float(np.quantile(t, 0.99))},
        }
        for (n, m), t in zip(cases, times, strict=True)
    ]


def format_scaling(rows: Sequence[dict[str, Any]]) -> str:
    """Render `scaling` as a table; ratios are to N = 20 with 4 obstacles."""
    base = next(r["ms"] for r in rows if (r["horizon"], r["obstacles"]) == (20, 4))
    lines = [
        f"{'horizon':>8}{'obstacles':>10}{'p50':>9}{'p99':>9} [ms]{'p50':>8}{'p99':>8} x (20, 4)"
    ]
    for r in rows:
        t = r["ms"]
        lines.append(
            f"{r['horizon']:>8}{r['obstacles']:>10}{t['p50']:9.3f}{t['p99']:9.3f}     "
            f"{t['p50'] / base['p50']:8.2f}{t['p99'] / base['p99']:8.2f}"
        )
    return "\n".join(lines)
