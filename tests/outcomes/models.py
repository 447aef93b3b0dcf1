"""Models that are driven; each is learned once in a process."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np

import kmpc_lite as kl
from outcomes.lab import Condition, RealPlant, Robot, learn_robot, real_robot
from outcomes.plant import Array, Body, Vehicle

NOISE = (0.005, 0.02)  # standard deviation of a good pose [m, rad]
PLACES = [Path(__file__).parents[up] / "shared" / "data" for up in (3, 4)]
"""Where logs may lie: beside the repository, or beside the folder of its work trees."""
DATA = next((place for place in PLACES if place.is_dir()), PLACES[0])
LOGS = {
    "husky": ("norlab_drive/husky.csv", 0.5, 1.0, 1.0),
    "warthog": ("norlab_drive/warthog.csv", 0.9, 4.0, 2.0),
    "rover, quiet": ("rover_sitl/quiet.csv", 0.25, 0.5, 0.8),
    "rover, busy": ("rover_sitl/busy.csv", 0.25, 0.5, 0.8),
}
"""File, radius [m], speed [m/s] and turn rate [rad/s] of robots that logs are of."""


def _lesson(
    slip: float,
    lag: float = 0.0,
    dead_time: float = 0.0,
    noise: float = 0.0,
    turning_point: tuple[float, float] = (0.0, 0.0),
) -> tuple[Condition, float]:
    spread = (noise * NOISE[0], noise * NOISE[0], noise * NOISE[1])
    condition = Condition("log", lag, dead_time, spread, turning_point=turning_point)
    return condition, slip


LESSONS = {
    "slip": _lesson(0.05),
    "calm": _lesson(0.01),
    "slippery": _lesson(0.2),
    "lag": _lesson(0.02, 0.3, 0.15),
    "lag, noise": _lesson(0.02, 0.3, 0.15, 1.0),
    "noise": _lesson(0.03, noise=1.0),
    "much noise": _lesson(0.03, noise=2.5),
    "turning ahead": _lesson(0.03, turning_point=(0.05, 0.02)),
    "turning back": _lesson(0.03, turning_point=(-0.04, 0.0)),
}
"""Conditions and slips of the paper's robot that models are learned from."""


@cache
def model(name: str, dt: float = 0.1) -> kl.KoopmanModel:
    """Model by its name: ``nominal``, ``paper``, or one of `LESSONS`."""
    if name == "nominal":
        return kl.nominal_unicycle(dt)
    if name == "paper":
        return LESSONS["slip"][0].learn(0.05, "edmdc", 60, 200)
    condition, slip = LESSONS[name]
    return condition.learn(slip, "integral", 60, 200)


@cache
def learned(robot: Robot, seed: int) -> kl.KoopmanModel:
    """Model of a drawn robot, learned from its log as ``kmpc fit`` does."""
    return learn_robot(robot, seed)


@cache
def learned_body(
    body: Body,
    dt: float,
    bounds: tuple[float, float],
    noise: tuple[float, float] = (0.0, 0.0),
    seconds: float = 120.0,
    seed: int = 0,
) -> kl.KoopmanModel:
    """Model of a body from a log of random commands, held as long as its ramps take."""
    random, plant = np.random.default_rng([seed, 5]), Vehicle(body, dt, [seed, 6])
    longest = max(0.5, 0.7 * float(np.max(np.array(bounds) / body.ramp)))
    count, hold = round(seconds / dt), max(round(longest / dt), 1)
    drawn = random.uniform(-1.0, 1.0, (count // hold + 1, 2)) * bounds
    commands = np.repeat(drawn, hold, axis=0)[:count]
    spread, pose = np.array((noise[0], noise[0], noise[1])), np.zeros(3)
    seen = [pose + spread * random.normal(size=3)]
    for command in commands:
        pose = plant.drive(pose, command)[-1]
        seen.append(pose + spread * random.normal(size=3))
    log = kl.Dataset([kl.Episode(np.array(seen), commands, dt)])
    train, held = log.windows(10.0).split(0.5, seed=0)
    return kl.with_quantiles(kl.fit(train, lags="auto"), held)


@cache
def of_log(name: str) -> tuple[kl.KoopmanModel, kl.KoopmanModel, kl.Dataset] | None:
    """Model of one half of a real log, and model and drives of the other; None without the log."""
    file, *numbers = LOGS[name]
    if not (DATA / file).is_file():
        return None
    mine, its = real_robot(DATA / file, *numbers).halves()
    train, held = mine.split(0.5, seed=7201)
    return kl.with_quantiles(kl.fit(train, lags="auto"), held), kl.fit(its, lags="auto"), its


def real_plant(name: str, seed: int) -> RealPlant:
    """Plant that moves and errs as the other half of a log; motors lag by a tenth of a second."""
    found = of_log(name)
    assert found is not None
    return RealPlant(found[1], found[2], seed, 0.1)


def pose_noise(found: kl.KoopmanModel) -> tuple[float, float]:
    """Standard deviation of the measured poses that a model was learned from [m, rad]."""
    at_rest: Array = np.sqrt(np.maximum(np.diag(found.noise(np.zeros(2))), 0.0) / 2.0)
    return float(at_rest[:2].mean()), float(at_rest[2])
