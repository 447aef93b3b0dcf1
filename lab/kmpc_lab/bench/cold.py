"""Steps as a robot makes them: each contender steps once, after a sleep, then the next one does.

What a contender had in the processor's caches is gone by its next step.
"""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from kmpc_lab.bench.boards import this_machine
from kmpc_lab.bench.drives import RecordedDrive, learned_model, record
from kmpc_lab.bench.lidar import make_controller, record_turn
from kmpc_lab.bench.measure import HEAD, QUANTILES, format_times, in_ms
from kmpc_lab.peers.paper import papers_problem
from kmpc_lab.studies.contenders import COLD_CONTENDERS, FULL_STEP, Contender
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.model.koopman import KoopmanModel

PAUSE = 0.01
"""Sleep before each step [s]."""
PAST_CIRCLES = "past four circles, on the states of full steps; peers solve the paper's problem"
BY_LIDAR = "full steps past circles and by lidar"
Row = dict[str, Any]
Progress = Callable[[int, int], None]


class _Stepped:
    """A controller that is stepped in turns, and how long its steps took."""

    def __init__(self, name: str, controller: Any, timed: str) -> None:
        self.name, self.controller, self._timed = name, controller, timed
        self.times: list[float] = []

    def step(self, step: tuple[Any, ...], first: bool) -> None:
        """Step once; the first step of a drive is not counted: it has no plan to start from."""
        time.sleep(PAUSE)
        begin = time.perf_counter()
        plan = self.controller.step(*step)
        took = time.perf_counter() - begin
        if not first:
            self.times.append(took if self._timed == "total" else plan.timing[self._timed])

    def as_dict(self) -> Row:
        """Plain values, for JSON."""
        return {"name": self.name, "steps": len(self.times), "ms": in_ms(self.times)}


def cold_steps(
    field_of: Sequence[Contender],
    model: KoopmanModel,
    problem: NavigationProblem,
    drives: Sequence[RecordedDrive],
    progress: Progress,
) -> list[Row]:
    """Time the steps of contenders from the same states, in turns step by step.

    `field_of`: those that take part; times are compared with those of the first. `model`,
    `problem`: for all of them. `drives`: recorded states. `progress`: called as drives finish.
    Returns for each contender ``name``, ``steps``, and ``ms`` (p50, p99, p99.9 and max of a step).
    """
    most = max(len(drive.circles) for drive in drives)
    stepped = [_Stepped(c.label, c.make(model, problem, most), c.timed) for c in field_of]
    recorded = [[(x, d.goal, d.circles) for x in d.states] for d in drives]
    for i, steps in enumerate(recorded):
        _in_turns(stepped, steps)
        progress(i + 1, len(drives))
    return [one.as_dict() for one in stepped]


def cold_lidar_steps(drives: int, seed: int, progress: Progress) -> list[Row]:
    """Time steps past circles and by lidars (`lidar.BEAMS`).

    `drives`: of each kind. `seed`: of the first; the others follow. `progress`: called as drives
    finish. Returns as of `cold_steps`, for each kind of drive.
    """
    driver = make_controller()
    rows: dict[str, list[_Stepped]] = {}
    for i in range(drives):
        for kind, steps in record_turn(driver, i, seed + i).items():
            if kind not in rows:
                rows[kind] = [_Stepped(kind, make_controller(), "total")]
            _in_turns(rows[kind], steps)
        progress(i + 1, drives)
    return [one.as_dict() for kind in rows.values() for one in kind]


def _in_turns(stepped: Sequence[_Stepped], steps: Sequence[tuple[Any, ...]]) -> None:
    """Let all drive one recorded drive; who steps first changes from step to step."""
    for one in stepped:
        one.controller.reset()
    gc.collect()
    for k, step in enumerate(steps):
        for j in np.roll(np.arange(len(stepped)), k).tolist():
            stepped[j].step(step, first=k == 0)


def compare_cold(
    drives: int, steps: int, obstacles: int, seed: int, progress: Progress, by_lidar: Progress
) -> dict[str, Any]:
    """All tables: contenders on the states of full steps, and full steps by lidar.

    `drives`, `steps`, `obstacles`: recorded drives of each kind, states of those past circles, and
    how many circles. `seed`: of the first drive; the others follow. `progress`, `by_lidar`: called
    as drives of each table finish. Returns ``machine``, ``tables`` by their titles, and why
    contenders were ``left_out``.
    """
    model, problem = learned_model(), papers_problem()
    left_out = {c.label: c.missing for c in COLD_CONTENDERS if c.missing}
    field_of = [c for c in COLD_CONTENDERS if c.label not in left_out]
    states = record(model, problem, drives, steps, obstacles, seed, FULL_STEP)
    tables = {
        PAST_CIRCLES: cold_steps(field_of, model, problem, states, progress),
        BY_LIDAR: cold_lidar_steps(drives, seed, by_lidar),
    }
    return {"machine": this_machine(), "tables": tables, "left_out": left_out}


def format_cold(told: Mapping[str, Any]) -> str:
    """Render `compare_cold`; ratios are to the first row of each table."""
    lines = []
    head = f"{'':<28}{'steps':>7}{HEAD}{''.join(f'{p:>9}' for p in QUANTILES)} x first"
    for title, rows in told["tables"].items():
        lines += [title, head]
        first = rows[0]["ms"]
        for row in rows:
            ratios = "".join(f"{row['ms'][p] / first[p]:9.3f}" for p in QUANTILES)
            times = format_times(row["ms"])
            lines.append(f"{row['name']:<28}{row['steps']:>7}{times}     {ratios}")
        lines.append("")
    lines += [f"left out: {name}: {reason}" for name, reason in told["left_out"].items()]
    return "\n".join(lines)
