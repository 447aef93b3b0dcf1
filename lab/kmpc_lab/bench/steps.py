"""Steps as a robot makes them: each contender steps once, after a sleep, then the next one does.

What a contender had in the processor's caches is gone by its next step.
"""

from __future__ import annotations

import gc
import os
import platform
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from kmpc_lab.bench.drives import learned_model, make_controller, record, record_turn
from kmpc_lab.peers.ipopt import papers_problem
from kmpc_lab.studies.contenders import COLD_CONTENDERS, FULL_STEP, Contender, solver_contenders
from kmpc_lite import __version__
from kmpc_lite.errors import ProblemError

MODEL = Path("/proc/device-tree/model")
"""Where a board with a device tree, such as a Raspberry Pi, says what it is."""
QUANTILES = {"p50": 0.5, "p99": 0.99, "p99.9": 0.999}
"""By their names in tables and in JSON; beside them stands ``max``."""
HEAD = "".join(f"{name:>9}" for name in (*QUANTILES, "max")) + " [ms]"  # head of `format_times`
PAUSE = 0.01  # sleep before each step [s]
PAST_CIRCLES = "past four circles, on the states of full steps; peers solve the paper's problem"
BY_LIDAR = "full steps past circles and by lidar"
BY_SOLVER = "the paper's problem past four circles, by QP solver"
Progress = Callable[[int, int], None]


def this_machine() -> dict[str, Any]:
    """Say on what a benchmark runs, as values that JSON can hold."""
    return {
        "name": _name(),
        "architecture": platform.machine(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "kmpc_lite": __version__,
    }


def _name() -> str:
    """Name of the board, or of its processor."""
    if MODEL.exists():
        return MODEL.read_text().rstrip("\0\n")
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.partition(":")[2].strip()
    return platform.machine()


def format_times(ms: Mapping[str, float]) -> str:
    """Columns below `HEAD`."""
    return "".join(f"{ms[name]:9.3f}" for name in (*QUANTILES, "max"))


class Stepped:
    """A controller that is stepped in turns, how long its steps took, and how many had no plan."""

    def __init__(self, name: str, controller: Any, timed: str = "total") -> None:
        self.name, self.controller, self._timed = name, controller, timed
        self.times, self.unsolved = list[float](), 0

    def step(self, step: tuple[Any, ...], first: bool) -> None:
        """Step once; the first step of a drive is not counted: it has no plan to start from."""
        time.sleep(PAUSE)
        begin = time.perf_counter()
        plan = self.controller.step(*step)
        took = time.perf_counter() - begin
        if not first:
            self.times.append(took if self._timed == "total" else plan.timing[self._timed])
            self.unsolved += plan.status.name in ("FALLBACK", "STOPPED")

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        ms = 1e3 * np.asarray(self.times)
        told = {p: float(np.quantile(ms, q)) for p, q in QUANTILES.items()}
        told |= {"max": float(ms.max())}
        return {"name": self.name, "steps": len(ms), "ms": told, "unsolved": self.unsolved}


Tables = dict[str, list[Stepped]]


def _in_turns(stepped: Sequence[Stepped], steps: Sequence[tuple[Any, ...]]) -> None:
    """Let all drive one recorded drive; who steps first changes from step to step."""
    for one in stepped:
        one.controller.reset()
    gc.collect()
    for k, step in enumerate(steps):
        for j in np.roll(np.arange(len(stepped)), k).tolist():
            stepped[j].step(step, first=k == 0)


def past_circles(
    everyone: Sequence[Contender], driver: Contender, drives: int, seed: int, progress: Progress
) -> list[Stepped]:
    """Let contenders step from the states of recorded drives past four circles.

    `driver`: whose drives they are. `seed`: of the first drive; the others follow. `progress`:
    called as drives finish.
    """
    model, problem = learned_model(), papers_problem()
    recorded = record(model, problem, drives, seed, driver=driver)
    most = max(len(drive.circles) for drive in recorded)
    stepped = [Stepped(c.label, c.make(model, problem, most), c.timed) for c in everyone]
    for i, drive in enumerate(recorded):
        _in_turns(stepped, [(x, drive.goal, drive.circles) for x in drive.states])
        progress(i + 1, drives)
    return stepped


def by_lidar(drives: int, seed: int, progress: Progress) -> list[Stepped]:
    """Step past circles and by lidars (`lidar.BEAMS`), on drives of each kind."""
    driver, rows = make_controller(), dict[str, Stepped]()
    for i in range(drives):
        for kind, steps in record_turn(driver, i, seed + i).items():
            one = rows.setdefault(kind, Stepped(kind, make_controller()))
            _in_turns([one], steps)
        progress(i + 1, drives)
    return list(rows.values())


def compare(
    drives: int, seed: int, only: Sequence[str] | None, *progress: Progress
) -> tuple[Tables, dict[str, str]]:
    """Tables of all contenders, and of lidars; and why contenders were left out.

    `only`: parts of names; all if not given. `progress`: for each table. Raises ProblemError if
    none is left.
    """
    words = [word.lower() for word in only or ("",)]
    chosen = [c for c in COLD_CONTENDERS if any(word in c.label.lower() for word in words)]
    left_out = {c.label: c.missing for c in chosen if c.missing}
    if not (taking_part := [c for c in chosen if not c.missing]):
        names = ", ".join(c.label for c in COLD_CONTENDERS)
        raise ProblemError(f"--only {' '.join(only or ())}: none is left; names are {names}")
    tables = {PAST_CIRCLES: past_circles(taking_part, FULL_STEP, drives, seed, progress[0])}
    if only is None:
        tables[BY_LIDAR] = by_lidar(drives, seed, progress[1])
    return tables, left_out


def compare_solvers(drives: int, seed: int, progress: Progress) -> tuple[Tables, dict[str, str]]:
    """Table of all QP solvers that qpsolvers finds here, beside OSQP."""
    everyone = solver_contenders()
    return {BY_SOLVER: past_circles(everyone, everyone[0], drives, seed, progress)}, {}


def as_dict(tables: Tables, left_out: Mapping[str, str]) -> dict[str, Any]:
    """Plain values, for JSON."""
    rows = {title: [one.as_dict() for one in table] for title, table in tables.items()}
    return {"machine": this_machine(), "tables": rows, "left_out": dict(left_out)}


def format_tables(told: Mapping[str, Any]) -> str:
    """Render `as_dict`; ratios are to the first row of each table."""
    lines = []
    head = f"{'':<28}{'steps':>7}{HEAD}{''.join(f'{p:>9}' for p in QUANTILES)} x first  unsolved"
    for title, rows in told["tables"].items():
        lines += [title, head]
        first = rows[0]["ms"]
        for row in rows:
            ratios = "".join(f"{row['ms'][p] / first[p]:9.3f}" for p in QUANTILES)
            times = f"{format_times(row['ms'])}     {ratios}{row['unsolved']:>18}"
            lines.append(f"{row['name']:<28}{row['steps']:>7}{times}")
        lines.append("")
    lines += [f"left out: {name}: {reason}" for name, reason in told["left_out"].items()]
    return "\n".join(lines)
