"""Step times and plan quality on recorded states, solver by solver, interleaved in one run."""

from __future__ import annotations

import gc
import resource
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import RecordedDrive
from kmpc_lab.peers.paper import short_way
from kmpc_lab.report.style import LINES, legend_below, new_figure, render, style, write_picture
from kmpc_lab.studies.contenders import Contender
from kmpc_lite.control.kernels.clearance import distances, things_of
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.types import Array

QUANTILES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
"""By their names in tables and in JSON; beside them stands ``max``."""
HEAD = "".join(f"{name:>9}" for name in (*QUANTILES, "max")) + " [ms]"
"""Head of `format_times`."""


def in_ms(seconds: Sequence[float]) -> dict[str, float]:
    """Quantiles and maximum of times [s], in ms."""
    ms = 1e3 * np.asarray(seconds)
    return {**{p: float(np.quantile(ms, q)) for p, q in QUANTILES.items()}, "max": float(ms.max())}


def format_times(ms: Mapping[str, float]) -> str:
    """Columns below `HEAD`."""
    return "".join(f"{ms[name]:9.3f}" for name in (*QUANTILES, "max"))


IMPORTS = 5
"""How often each import is timed."""
TUNING_SEED, REPORTING_SEED = 7_000, 700_000
"""First seeds of the recorded drives: for finding settings, and for what is reported."""


@dataclass(eq=False)
class Measurement:
    """What one contender did."""

    name: str
    times: list[float] = field(default_factory=list)
    """Of each warm step [s]."""
    cold: list[float] = field(default_factory=list)
    """Of the first step of each drive [s]."""
    phases: dict[str, list[float]] = field(default_factory=dict)
    cost: list[float] = field(default_factory=list)
    """Objective of each plan."""
    violation: list[float] = field(default_factory=list)
    """How deep each plan enters an obstacle or leaves the area [m]."""
    defect: list[float] = field(default_factory=list)
    """How far the model contradicts each plan over one period [m, rad]."""
    unsolved: int = 0
    """Steps without a plan of its own."""
    memory: float = 0.0
    """Growth of the process while it was built and ran [MB]."""

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; times in milliseconds."""
        return {
            "name": self.name,
            "steps": len(self.times),
            "ms": in_ms(self.times),
            "cold_ms": {"p50": 1e3 * float(np.median(self.cold)), "max": 1e3 * max(self.cold)},
            "phases_ms": {k: 1e3 * float(np.median(v)) for k, v in self.phases.items()},
            "cost_median": float(np.median(self.cost)),
            "violation_mm": {
                "p99": 1e3 * float(np.quantile(self.violation, 0.99)),
                "max": 1e3 * max(self.violation),
            },
            "defect_mm": {
                "p99": 1e3 * float(np.quantile(self.defect, 0.99)),
                "max": 1e3 * max(self.defect),
            },
            "unsolved": self.unsolved,
            "memory_mb": self.memory,
        }


def measure(
    field_of: Sequence[Contender],
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: Sequence[RecordedDrive],
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Measurement]:
    """Let every contender plan from every state; they take turns drive by drive, in changing order.

    `field_of`: those that take part. `model`, `problem`: for all of them. `drives`: recorded
    states. `progress`: called as drives finish.
    """
    results, controllers = [], []
    count = max((len(d.circles) for d in drives), default=0)
    for contender in field_of:
        before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        controllers.append(contender.make(model, problem, count))
        controllers[-1].step(drives[0].states[0], drives[0].goal, drives[0].circles)
        grown = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
        results.append(Measurement(contender.label, memory=grown / 1024))
    # as before a loop on a robot: what exists by now need not be looked through again
    gc.collect()
    gc.freeze()
    for i, drive in enumerate(drives):
        for j in np.roll(np.arange(len(field_of)), i).tolist():
            _run(controllers[j], field_of[j].timed, drive, model, problem, results[j])
        progress(i + 1, len(drives))
    return results


def _run(
    controller: Any,
    timed: str,
    drive: RecordedDrive,
    model: KoopmanModel,
    problem: NavigationProblem,
    result: Measurement,
) -> None:
    """One contender over one drive: first all steps, then the looking at what they found."""
    controller.reset()
    plans = [controller.step(x, drive.goal, drive.circles) for x in drive.states]
    for k, (x, plan) in enumerate(zip(drive.states, plans, strict=True)):
        (result.times if k else result.cold).append(plan.timing[timed])
        if k:
            for phase, seconds in plan.timing.items():
                result.phases.setdefault(phase, []).append(seconds)
        if plan.status.name in ("FALLBACK", "STOPPED"):
            result.unsolved += 1
            continue
        goal = short_way(drive.goal, x)
        result.cost.append(problem.cost(plan.states, plan.inputs, goal))
        result.violation.append(violation(plan.states, drive.circles, problem))
        result.defect.append(
            float(np.abs(model.predict(plan.states[:-1], plan.inputs) - plan.states[1:]).max())
        )


def violation(states: Array, circles: Array, problem: NavigationProblem) -> float:
    """How deep a plan (N + 1, 3) enters an obstacle or leaves the area after its start [m]."""
    _, _, x_min, x_max = problem.bounds
    positions = states[1:, :2]
    deepest = max(0.0, float((x_min[:2] - positions).max()), float((positions - x_max[:2]).max()))
    if len(circles):
        gaps = distances(things_of(circles), positions, problem.dt * np.arange(1, len(states)))
        deepest = max(deepest, problem.robot_radius + problem.margin - float(gaps.min()))
    return deepest


def import_times() -> dict[str, float]:
    """Median time to import this package, and what it stands on, in fresh interpreters [s]."""
    code = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
    what = {"kmpc_lite": "kmpc_lite.api", "numpy, scipy.sparse, osqp": "numpy, scipy.sparse, osqp"}
    times: dict[str, list[float]] = {name: [] for name in what}
    for _ in range(IMPORTS):
        for name, modules in what.items():
            done = subprocess.run(
                [sys.executable, "-c", code.format(modules)],
                capture_output=True,
                text=True,
                check=True,
            )
            times[name].append(float(done.stdout))
    return {name: float(np.median(values)) for name, values in times.items()}


def format_measurements(results: Sequence[Measurement]) -> str:
    """Render a table; ratios are of the medians, and of p99, to the first row's."""
    head = (
        f"{'':<18}{HEAD}{'p50':>7}{'p99':>7} x first{'cost':>9}{'violation':>11}{'defect':>9} [mm]"
    )
    lines = [head + f"{'unsolved':>10}"]
    first = results[0].as_dict()["ms"]
    for result in results:
        d = result.as_dict()
        t = d["ms"]
        lines.append(
            f"{d['name']:<18}{format_times(t)}     "
            f"{t['p50'] / first['p50']:7.1f}{t['p99'] / first['p99']:7.1f}        "
            f"{d['cost_median']:9.2f}"
            f"{d['violation_mm']['p99']:11.2f}{d['defect_mm']['p99']:9.2f}     {d['unsolved']:>10}"
        )
    lines.append("")
    for result in results:
        d = result.as_dict()
        phases = ", ".join(f"{name} {value:.3f}" for name, value in d["phases_ms"].items())
        lines.append(
            f"{d['name']:<18} median by phase [ms]: {phases}; "
            f"cold start {d['cold_ms']['p50']:.2f}; memory +{d['memory_mb']:.0f} MB"
        )
    return "\n".join(lines)


def write_bench_picture(path: Path, results: Sequence[Measurement]) -> None:
    """Draw the tails of the distributions into a PNG: it is the tail that misses deadlines.

    Both axes are logarithmic.
    """
    with style():
        figure = new_figure(3.6)
        axes = figure.add_subplot()
        handles = []
        for result, (colour, line, marker) in zip(results, LINES, strict=False):
            times = 1e3 * np.sort(result.times)
            share = 1.0 - np.arange(len(times)) / len(times)
            every = max(1, len(times) // 8)
            handles += axes.step(
                times,
                share,
                where="post",
                color=colour,
                linestyle=line,
                marker=marker,
                markevery=every,
                markersize=4,
                label=result.name,
            )
        axes.set_xscale("log")
        axes.set_yscale("log")
        axes.set_xlabel("time of a step [ms]")
        axes.set_ylabel("share of steps that took longer")
        axes.set_title(f"{len(results[0].times)} steps each, the same states, in one run")
        legend_below(figure, handles)
        write_picture(path, render(figure, "png"))
