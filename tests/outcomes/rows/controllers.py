"""Faults of the solver, copies, the paper's mode and options, plants of real logs."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models
from outcomes.broken_solver import BrokenWorkspace, Switch
from outcomes.plant import Body
from outcomes.rows.build import LAGS, Table, bundled, on_map
from outcomes.setup import Setup

SOLVER = Table("solver")


def broken(
    seed: int, fault: str, first: int, after: int, number: int, every: int = 1, **more: Any
) -> Setup:
    """OSQP ends with a fault from one step until another."""
    switch = Switch(np.random.default_rng([seed, number]))

    def before(k: int, _: kl.Controller) -> None:
        switch.fault = fault if first <= k < after and k % every == 0 else ""

    def make(qp: Any, options: Any) -> Any:
        return BrokenWorkspace(switch, qp, options)

    setup = on_map(seed, "dense", number, **more)
    setup.before, setup.options = before, {**setup.options, "solver": make}
    return setup


for number, fault in enumerate(
    (
        "max iter",
        "primal infeasible",
        "dual infeasible",
        "time limit",
        "solved inaccurate",
        "non-convex",
        "update refused",
        "unsolved",
    )
):
    SOLVER.add(
        f"'{fault}' for a second and a half",
        broken,
        fault,
        12,
        27,
        310 + number,
        model="slip",
        quick=fault in ("primal infeasible", "update refused"),
    )
for number, fault in enumerate(("primal infeasible", "max iter")):
    SOLVER.add(f"'{fault}' every third step", broken, fault, 3, 400, 318 + number, 3, model="slip")
    SOLVER.add(
        f"'{fault}' for a second, a robot that lags",
        broken,
        fault,
        12,
        22,
        320 + number,
        model="lag",
        body=LAGS,
    )
SOLVER.add(
    "'primal infeasible' for good stops it",
    broken,
    "primal infeasible",
    12,
    10**6,
    322,
    model="slip",
    limit=12.0,
    right="waiting",
)
SOLVER.add("'max iter' for good is driven with", broken, "max iter", 12, 10**6, 323, model="slip")


class Ticks:
    """A clock that goes on by so much at each look [s]."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._now = seconds, 0.0

    def __call__(self) -> float:
        self._now += self._seconds
        return self._now


def budgeted(seed: int, seconds: float, number: int, **options: Any) -> Setup:
    setup = on_map(seed, "dense", number, model="slip")
    setup.options = {"time_budget": 1.0, "clock": Ticks(seconds), **options}
    return setup


SOLVER.add("a time budget that is never spent", budgeted, 1e-6, 324)
SOLVER.add("passes to convergence within a time budget", budgeted, 0.06, 325, sqp_iterations=8)
for number, name in enumerate(("clarabel", "daqp", "piqp")):
    SOLVER.add(
        f"{name} instead of OSQP",
        on_map,
        "dense",
        326 + number,
        options={"solver": name},
        model="slip",
    )

STATE = Table("state")


def handed_over(seed: int, number: int, how: str, **more: Any) -> Setup:
    """In the middle of the drive a copy drives on, or the controller is changed."""

    def before(k: int, controller: kl.Controller) -> kl.Controller | None:
        if how == "copied" and k % 7 == 6:
            return copy.deepcopy(controller)
        if how == "pickled" and k == 20:
            return pickle.loads(pickle.dumps(controller))  # type: ignore[no-any-return]
        if how == "reset" and k == 20:
            controller.reset()
        if how == "swapped" and k == 20:
            controller.update_model(models.model("calm"))
        return None

    setup = on_map(seed, "dense", number, **{"model": "slip", **more})
    setup.before = before
    return setup


STATE.add("a copy drives on, again and again", handed_over, 330, "copied")
STATE.add("a pickle drives on", handed_over, 331, "pickled", model="lag", body=LAGS)
STATE.add("reset in the middle", handed_over, 332, "reset")
STATE.add("another model in the middle", handed_over, 333, "swapped", quick=True)


def gated(seed: int, number: int, told: bool) -> Setup:
    """A gate with acceleration limits lies between controller and robot."""
    setup = on_map(seed, "dense", number, model="slip", gate=(0.6, 2.0))
    if told:
        setup.problem = kl.NavigationProblem(du_max=(0.6, 2.0))
    return setup


STATE.add("a gate of 0.6 m/s^2 that the controller is told of", gated, 334, True)
STATE.add("a gate of 0.6 m/s^2 that shows in what was sent alone", gated, 335, False, quick=True)

PAPER = Table("paper and options")
PLAIN: dict[str, Any] = {"guidance": False, "tightening": None}
for number, (word, options, model) in enumerate(
    (
        ("as in the paper", PLAIN, "paper"),
        ("as in the paper, on an open map", PLAIN, "slip"),
        ("without guidance", {"guidance": False}, "slip"),
        ("without margins", {"tightening": None}, "slip"),
    )
):
    PAPER.add(word, on_map, "open", 340 + number, model=model, options=options, limit=20.0)
for passes in (2, 8, 50):
    PAPER.add(
        f"{passes} passes", on_map, "dense", 345, model="slip", options={"sqp_iterations": passes}
    )
PAPER.add("risk 0.2", on_map, "dense", 346, model="slip", options={"risk": 0.2})
PAPER.add("risk 0.001", on_map, "dense", 347, model="lag", body=LAGS, options={"risk": 0.001})
PAPER.add("two obstacle slots", on_map, "dense", 348, model="slip", options={"obstacle_slots": 2})
PAPER.add("a margin of 5 cm", on_map, "open", 349, model="slip", problem={"margin": 0.05})
PAPER.add(
    "weights of a user",
    on_map,
    "open",
    350,
    model="slip",
    problem={"Q": (2, 2, 0.5), "R": ((0.5, 0.1), (0.1, 0.2)), "Q_terminal": (10, 10, 1)},
)
PAPER.add("a robot of 10 cm", on_map, "narrow", 351, problem={"robot_radius": 0.1}, quick=True)

REAL = Table("real logs")


def logged(seed: int, name: str, number: int, **options: Any) -> Setup | None:
    """A plant of one half of a log, driven with a model of the other half."""
    found = models.of_log(name)
    if found is None:
        return None
    _, radius, speed, turn = models.LOGS[name]
    problem = {"u_min": (-speed, -turn), "u_max": (speed, turn), "robot_radius": radius}
    model = found[0] if options.pop("learned", True) else "nominal"
    return on_map(
        seed,
        "open",
        number,
        by=radius / 0.15,
        model=model,
        problem=problem,
        plant=models.real_plant(name, number + 100 * seed),
        noise=models.pose_noise(found[1]),
        limit=90.0,
        options=options,
    )


for name, count in (("husky", 3), ("warthog", 3), ("rover, quiet", 2), ("rover, busy", 2)):
    for number in range(count):
        REAL.add(f"learned from the log of a {name}, map {number}", logged, name, 360 + number)
REAL.add("the log of a warthog, adapted", logged, "warthog", 363, adaptation=True)
REAL.add("the log of a husky, adapted: gains were absurd", logged, "husky", 363, adaptation=True)
REAL.add("the rover's busy log, nominal model", logged, "rover, busy", 360, learned=False)
for name in ("walls_door", "four_circles_2"):
    REAL.add(
        f"lags of a real rover in {name}",
        bundled,
        name,
        body=Body(0.0, lag=0.12, dead_time=0.1, ramp=(1.0, 3.0)),
    )
