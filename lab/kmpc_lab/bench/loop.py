"""The control loop at a fixed rate for minutes on a busy machine: how late its steps are."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np

from firmware_bridge.integration.course import BUDGET
from firmware_bridge.runtime.timing import Deadlines, Histogram
from kmpc_lab.bench.drives import SLIP, free_pose, random_circles
from kmpc_lab.bench.steps import HEAD, format_times
from kmpc_lab.sim.plants.robots import DifferentialDrive
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.problem import NavigationProblem
from kmpc_lite.geometry import distances
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.realtime import prepare_process

ANYTIME_PASSES = 100
"""Passes that a step with a budget may make: more than it will ever have time for."""


@dataclass(frozen=True)
class LoopResult:
    """What the loop saw."""

    rate: float  # [Hz]
    ticks: int
    setup: list[str]  # what `prepare_process` did and did not
    lateness: Histogram  # how late periods began [s]
    response: Histogram  # from a period's deadline to its command [s]
    steps: Histogram  # time of `Controller.step` alone [s]
    skipped: int  # periods that were left out
    statuses: dict[str, int]
    budget: float  # `Controller`'s time_budget [s]

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON; times in milliseconds."""
        period = 1.0 / self.rate
        return {
            "rate_hz": self.rate,
            "ticks": self.ticks,
            "setup": self.setup,
            **{name: getattr(self, name).summary() for name in ("lateness", "response", "steps")},
            "share_of_commands_after_their_period": self.response.share_above(period),
            "skipped_periods": self.skipped,
            "statuses": self.statuses,
            "budget_ms": 1e3 * self.budget,
            "share_of_steps_over_budget": self.steps.share_above(self.budget),
        }

    def __str__(self) -> str:
        """Render as text."""
        d = self.as_dict()
        lines = [*self.setup, f"{self.ticks} periods at {self.rate:g} Hz, {self.skipped} skipped"]
        lines.append(f"{'':<34}{HEAD}")
        for name, text in (
            ("lateness", "period begins late by"),
            ("steps", "Controller.step"),
            ("response", "deadline to command"),
        ):
            lines.append(f"{text:<34}{format_times(d[name])}")
        lines.append(
            "commands that came after their period: "
            f"{100 * d['share_of_commands_after_their_period']:.4f} %; {self.statuses}"
        )
        over, p999 = d["share_of_steps_over_budget"], d["steps"]["p99.9"] / d["budget_ms"]
        lines.append(
            f"budget of {d['budget_ms']:g} ms: {100 * over:.3f} % of the steps took longer, "
            f"p99.9 is {p999:.2f} of it"
        )
        return "\n".join(lines)


def _spin(core: int) -> None:
    """Keep a core busy."""
    try:
        os.sched_setaffinity(0, {core})
    except (AttributeError, OSError):
        pass  # the load then moves between cores: harder, not easier
    value = 1.0
    while True:
        value = float(np.sqrt(value + 1.0))


@contextmanager
def busy_cores(cores: list[int]) -> Any:
    """Run a process at full load on each of these cores for the duration of the block."""
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_spin, args=(core,), daemon=True) for core in cores]
    for process in processes:
        process.start()
    try:
        time.sleep(1.0)
        yield
    finally:
        for process in processes:
            process.terminate()


def run_loop(
    model: KoopmanModel,
    problem: NavigationProblem,
    rate: float,
    seconds: float,
    seed: int,
    load: bool = True,
    budget: float | None = None,
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> LoopResult:
    """Drive from goal to goal on random maps in real time, the other cores saturated.

    `model`, `problem`: every tick of the loop is one period of the problem: at 100 Hz a robot with
    dt = 0.1 s lives ten times as fast. `rate`, `seconds`: of the loop [Hz], [s]. `seed`: of maps
    and goals. `load`: whether the other cores are kept busy. `budget`: `Controller`'s time_budget
    [s]: steps then make as many passes as it allows; without it one, in the time that ``kmpc run``
    gives them. `progress`: called about once a second with seconds done and in all.
    """
    cores = sorted(os.sched_getaffinity(0))
    random = np.random.default_rng(seed)
    circles = random_circles(random, 4)
    x, goal = free_pose(random, circles), free_pose(random, circles)
    # a budget means something where there is more to do than it allows
    passes = 1 if budget is None else ANYTIME_PASSES
    budget = BUDGET / rate if budget is None else budget
    controller = Controller(
        model, problem, sqp_iterations=passes, tolerance=1e-9, time_budget=budget
    )
    plant = DifferentialDrive(SLIP, seed=seed)
    controller.step(x, goal, circles)
    response, steps = Histogram(), Histogram()
    statuses: dict[str, int] = {}
    with busy_cores(cores[:-1] if load else []):
        setup = prepare_process(cpu=cores[-1])
        began = time.monotonic()
        loop, late = Deadlines(1.0 / rate, began), Histogram()
        ticks = 0
        while (deadline := loop.next) < began + seconds:
            time.sleep(max(0.0, deadline - time.monotonic()))
            late.add(time.monotonic() - deadline)
            plan = controller.step(x, goal, circles)
            response.add(time.monotonic() - deadline)
            steps.add(plan.timing["total"])
            statuses[plan.status.name] = statuses.get(plan.status.name, 0) + 1
            x = plant.step(x, plan.command, problem.dt)
            ticks += 1
            if distances(x, goal) < 0.05 or ticks % 300 == 0:
                goal = free_pose(random, circles)
            if ticks % int(max(rate, 1)) == 0:
                progress(int(deadline - began), int(seconds))
            loop.advance(time.monotonic())
    return LoopResult(rate, ticks, setup, late, response, steps, loop.skipped, statuses, budget)
