"""The time budget on a fake clock: what is begun, what the solver is given, and what comes back."""

from __future__ import annotations

import gc
import os
import resource
from typing import Any

import numpy as np
import pytest
from guided import GuideInUse

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.control.nmpc.qp import NavigationQP
from kmpc_lite.control.nmpc.qp_solvers import QPData, QPSolution, QPSolver, choose_solver
from kmpc_lite.control.options import OSQPOptions
from kmpc_lite.realtime import prepare_process

GOAL = (1.5, 1.5, 0.0)
OBSTACLES = [kl.Circle(0.6, 0.6, 0.15)]


class Clock:
    """Advances by `tick` at every look, and by what the solver is made to take."""

    def __init__(self, tick: float = 0.0) -> None:
        self.now, self.tick = 0.0, tick

    def __call__(self) -> float:
        self.now += self.tick
        return self.now


def controller(
    clock: Clock, budget: float | None, qp_seconds: float, **options: Any
) -> tuple[kl.Controller, list[float]]:
    """Controller whose QPs take `qp_seconds`, or as long as they may.

    And the limits that they were given.
    """
    limits: list[float] = []

    def slow(qp: NavigationQP, options: OSQPOptions) -> QPSolver:
        workspace = choose_solver("osqp", qp, options)
        solve = workspace.solve

        def timed(data: QPData, time_limit: float | None = None) -> QPSolution:
            if time_limit is not None:
                limits.append(time_limit)
            clock.now += qp_seconds if time_limit is None else min(qp_seconds, time_limit)
            return solve(data)  # by this clock, not a busy machine's

        workspace.solve = timed  # type: ignore[method-assign]
        return workspace

    model = kl.nominal_unicycle(0.1)
    made = kl.Controller(model, time_budget=budget, clock=clock, solver=slow, **options)
    return made, limits


def test_no_pass_is_begun_that_would_not_end_in_time() -> None:
    clock = Clock()
    made, _ = controller(clock, 0.010, 0.004, sqp_iterations=9)
    plan = made.step((0, 0, 0), GOAL, OBSTACLES)
    assert plan.iterations == 2 and clock.now <= 0.010
    assert plan.status is kl.PlanStatus.FEASIBLE and "time budget" in plan.reason


def test_what_comes_after_a_solve_is_learned_and_kept_free() -> None:
    clock = Clock(tick=1e-4)
    made, limits = controller(clock, 0.010, 0.0)
    x = np.zeros(3)
    for _ in range(5):
        before = clock.now
        x = made.step(x, GOAL, OBSTACLES).states[1]
        assert clock.now - before <= 0.010
    assert all(limit < 0.010 - 5e-5 for limit in limits)


@pytest.mark.parametrize("iterations", [1, 50])
def test_a_budget_that_is_over_before_it_begins_still_gives_a_safe_plan(iterations: int) -> None:
    clock = Clock(tick=1.0)
    made, _ = controller(clock, 1e-3, 0.0, sqp_iterations=iterations)
    plan = made.step((0, 0, 0), GOAL, OBSTACLES)
    assert plan.iterations == 1
    assert (
        np.isfinite(plan.command).all()
        and (np.abs(plan.command) <= (0.6 + 1e-12, np.pi / 4 + 1e-12)).all()
    )


def test_a_search_for_a_way_is_left_to_the_next_steps_where_it_would_take_too_long() -> None:
    problem, now = kl.NavigationProblem(), [0.0]

    def clock() -> float:
        now[0] += 1.0
        return now[0]

    guide, x, scene = (
        GuideInUse(problem, clock=clock),
        np.zeros(3),
        np.array([[0.8, 0.0, 0.2, 0.0, 0.0]]),
    )
    found = [guide.reference(x, np.array(GOAL), scene, until=now[0] + 0.5) for _ in range(9)]
    last = next(k for k, f in enumerate(found) if f.refreshed)
    # it stands, which is not to say that there is no way
    assert last > 3 and all(f.reachable and (f.states == x).all() for f in found[:last])
    in_time = GuideInUse(problem, clock=clock).reference(x, np.array(GOAL), scene)
    assert in_time.refreshed and np.array_equal(found[last].path, in_time.path)
    # towards another goal it drives on along the old way
    other = np.array(GOAL) + (0.0, 0.5, 0.0)
    on = guide.reference(x, other, scene, until=now[0] + 0.5)
    assert not on.refreshed and np.array_equal(on.path, in_time.path)
    assert guide.reference(x, other, scene).refreshed


def endure(steps: int) -> float:
    """Growth of the process [MB] over drives from goal to goal, with dropped poses and changing
    maps.
    """
    random = np.random.default_rng(5)
    controller, plant = (
        kl.Controller(kl.nominal_unicycle(0.1)),
        kmpc_lab.DifferentialDrive(0.05, seed=1),
    )
    x, goal, circles = np.zeros(3), np.array([1.5, 1.5, 0.0]), np.array([[0.6, 0.6, 0.15]])
    before = 0
    for k in range(steps):
        measured = np.full(3, np.nan) if random.random() < 0.01 else x
        plan = controller.step(measured, goal, circles)
        assert np.isfinite(plan.command).all()
        x = plant.step(x, plan.command, 0.1)
        if k % 100 == 0:
            goal = np.array([*random.uniform(-1.8, 1.8, 2), random.uniform(-3, 3)])
            circles = np.column_stack([random.uniform(-1.5, 1.5, (4, 2)), np.full(4, 0.15)])
        if k == steps // 10:
            before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024


def test_memory_is_flat() -> None:
    assert endure(1_000) < 5.0


@pytest.mark.long
def test_memory_is_flat_over_100_000_steps() -> None:
    assert endure(100_000) < 5.0


def test_preparing_a_process_reports_what_was_not_permitted(monkeypatch: pytest.MonkeyPatch):
    def refuse(*_: object) -> None:
        raise PermissionError("not you")

    monkeypatch.setattr(os, "sched_setaffinity", refuse)
    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    try:
        told = "\n".join(prepare_process(cpu=0))
    finally:
        gc.unfreeze()
    assert "not pinned" in told and "not permitted (not you)" in told and "not limited" in told
