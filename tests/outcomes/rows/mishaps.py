"""Drives in which goals, poses or the controller change."""

from __future__ import annotations

import copy
import math
import pickle
from typing import Any

import numpy as np

import kmpc_lite as kl
from outcomes import models
from outcomes.broken_solver import BrokenWorkspace, Switch
from outcomes.lab import Jumps
from outcomes.rows.build import on_map, place
from outcomes.setup import Moment, Setup


def park(seed: int, number: int, **more: Any) -> Setup:
    """From within 0.6 m of the goal, whichever way both face."""
    random = np.random.default_rng([number, 91])
    bearing, away = random.uniform(-math.pi, math.pi), 0.6 * math.sqrt(random.uniform())
    start = (away * math.cos(bearing), away * math.sin(bearing), random.uniform(-3, 3))
    goal = (0.0, 0.0, random.uniform(-3, 3))
    return place(seed, start, goal, limit=40.0, **{"model": "slip", **more})


def tour(seed: int, number: int, count: int, every: float, **more: Any) -> Setup:
    """Goals that change while it drives."""
    setup = on_map(seed, "open", number, **{"model": "slip", "limit": 80.0, **more})
    random = np.random.default_rng([number, 93])
    places = [random.uniform((-1.7, -1.7, -9.0), (1.7, 1.7, 9.0)) for _ in range(60)]
    gaps = [
        np.hypot(*(setup.scene.circles[:, :2] - p[:2]).T).min() - setup.scene.circles[:, 2].max()
        for p in places
    ]
    free = [p for p, gap in zip(places, gaps, strict=True) if gap > 0.3][:count]
    setup.goals = tuple((every * (i + 1), goal) for i, goal in enumerate(free))
    return setup


def bad_numbers(seed: int, kind: str) -> Setup:
    """Obstacles or goals that are no numbers for a while."""
    setup = on_map(seed, "open", 385, model="slip")
    right = setup.sense

    def sense(moment: Moment) -> Any:
        if 12 <= moment.number < 18 and kind == "circle":
            return np.array([[np.nan, 0.0, 0.2, 0.0, 0.0]])
        if 12 <= moment.number < 18 and kind == "many":
            return np.tile((1.9, 1.9, 0.05, 0.0, 0.0), (20_000, 1))
        return right(moment)

    setup.sense = sense
    if kind == "goal":
        setup.goals = ((1.2, np.full(3, np.nan)), (1.8, setup.goal))
    return setup


def jumping(seed: int, kind: str, size: float, number: int) -> Setup:
    """A pose that jumps again and again, as ``kmpc study jumps`` drives it."""
    row = on_map(seed, "dense", number)
    jumps = Jumps(kind, size, 300 + number + 500 * seed)
    row.measure = lambda k, pose: pose + jumps.at(0.1 * k)
    row.tolerance = (0.05, 0.15)
    if kind == "for good":
        row.frame = lambda: jumps.frame
        row.sense = lambda moment: moment.scene.circles_at(moment.time)
    return row


# -- what happens to the controller


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


class Ticks:
    """A clock that goes on by so much at each look [s]."""

    def __init__(self, seconds: float) -> None:
        self._seconds, self._now = seconds, 0.0

    def __call__(self) -> float:
        self._now += self._seconds
        return self._now


def budgeted(seed: int, seconds: float, number: int, **options: Any) -> Setup:
    """Within a time budget, by a clock of its own."""
    setup = on_map(seed, "dense", number, model="slip")
    setup.options = {"time_budget": 1.0, "clock": Ticks(seconds), **options}
    return setup


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


def gated(seed: int, number: int, told: bool) -> Setup:
    """A gate with acceleration limits lies between controller and robot."""
    setup = on_map(seed, "dense", number, model="slip", gate=(0.6, 2.0))
    if told:
        setup.problem = kl.NavigationProblem(du_max=(0.6, 2.0))
    return setup


def logged(seed: int, name: str, number: int, learned: bool = True, **options: Any) -> Setup | None:
    """A plant of one half of a log, driven with a model of the other half."""
    found = models.of_log(name)
    if found is None:
        return None
    _, radius, speed, turn = models.LOGS[name]
    return on_map(
        *(seed, "open", number, radius / 0.15),
        model=found[0] if learned else "nominal",
        problem={"u_min": (-speed, -turn), "u_max": (speed, turn), "robot_radius": radius},
        plant=models.real_plant(name, number + 100 * seed),
        noise=models.pose_noise(found[1]),
        limit=90.0,
        options=options,
    )
