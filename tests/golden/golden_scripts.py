"""What a recorded drive is made of before it is driven, and the models that are driven."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np

import kmpc_lab
import kmpc_lite as kl

Random = np.random.Generator
FAMILIES = ("open", "dense", "narrow", "trap", "corridor", "moving", "polygons", "walls", "rooms")
ROBOT_NOISE = (0.005, 0.005, 0.02)
FAR_POLYGON = [[2e4, 0.0], [2e4, 1.0], [2.1e4, 0.0]]
Hook = Callable[[np.ndarray], dict[str, Any]]


@cache
def in_sim(name: str) -> Any:
    """A class or function of the package's simulations and studies, in whatever module it lives."""
    for package in ("kmpc_lab.sim", "kmpc_lab.studies"):
        try:
            folder = importlib.import_module(package)
        except ModuleNotFoundError:
            continue  # an older version has no such folder
        for module in pkgutil.walk_packages(folder.__path__, f"{package}."):
            # the twin has floors of its own, and needs what may not be installed
            if ".twin" not in module.name:
                found = getattr(importlib.import_module(module.name), name, None)
                if found is not None:
                    return found
    raise AttributeError(f"no {name} in the simulations and studies of kmpc_lite")


@dataclass
class Script:
    """One drive before it is driven."""

    kind: str
    start: np.ndarray
    model: str
    events: list[dict[str, Any]]
    problem: dict[str, Any] = field(default_factory=dict)
    options: dict[str, Any] = field(default_factory=dict)
    plant: dict[str, Any] = field(default_factory=dict)
    steps: int = 60
    noise: tuple[float, float, float] = (0.0, 0.0, 0.0)
    pose_age: float = 0.0
    kicks: dict[int, tuple[float, float, float]] = field(default_factory=dict)
    """Steps before which the robot is carried by so much."""
    poses: dict[int, list[float]] = field(default_factory=dict)
    """Steps at which something else is measured; NaN keeps what was."""
    blocked: range = range(0)
    """Steps in which the wheels turn and nothing moves."""
    gate: tuple[float, float] | None = None
    """Acceleration limits between controller and robot; what it lets through is told as `sent`."""
    pilot: dict[int, list[float]] = field(default_factory=dict)
    """Steps in which somebody else drives; NaN where nobody knows what was sent."""
    hooks: dict[int, Hook] = field(default_factory=dict)
    """Events that depend on where the robot then is."""
    turns: int = 0
    """Whole turns added to the measured heading."""
    ticking: bool = False
    """Whether the clock goes on from step to step."""

    def at(self, step: int, **event: Any) -> Script:
        """Add an event."""
        self.events.append({"step": step, **event})
        return self


def obstacles_of(scenario: Any, objects: bool = False) -> dict[str, Any]:
    """The obstacles of a map as an event has them."""
    table: dict[str, Any] = {
        "circles": [[float(v) for v in c] for c in scenario.circles],
        "objects": objects,
    }
    if scenario.polygons:
        table["polygons"] = [[list(corner) for corner in p.vertices] for p in scenario.polygons]
    if scenario.walls:
        table["walls"] = [[w.x1, w.y1, w.x2, w.y2, w.thickness] for w in scenario.walls]
    if scenario.grid is not None:
        rows = ["".join(".#"[int(cell)] for cell in row) for row in scenario.grid.occupied]
        table["grid"] = {
            "rows": rows,
            "resolution": scenario.grid.resolution,
            "origin": list(scenario.grid.origin),
        }
    return table


def draft(
    random: Random, kind: str, family: str, model: str = "slip", slip: float = 0.05, **more: Any
) -> Script:
    """A drive on a random map, from its start to its goal."""
    seed = int(random.integers(100_000))
    scenario = in_sim("random_map")(family, seed, slip)
    event = {
        "step": 0,
        "goal": list(scenario.goal),
        "obstacles": obstacles_of(scenario, bool(random.integers(2))),
    }
    problem = {
        "x_min": [*scenario.bounds[:2], -np.inf],
        "x_max": [*scenario.bounds[2:], np.inf],
        **more.pop("problem", {}),
    }
    plant = {"slip": slip, "seed": seed, **more.pop("plant", {})}
    return Script(
        f"{kind}, {family}", np.array(scenario.start), model, [event], problem, plant=plant, **more
    )


def pick(random: Random, i: int, families: tuple[str, ...] = FAMILIES) -> str:
    """Every family in its turn."""
    return families[i % len(families)]


def learn_models() -> dict[str, kl.KoopmanModel]:
    """The models that are driven, by name."""
    condition = in_sim("Condition")
    noise = ROBOT_NOISE
    lessons = {
        "slip": (condition(), 0.05, "integral"),
        "calm": (condition(), 0.01, "integral"),
        "paper": (condition(), 0.05, "edmdc"),
        "lag": (condition("lag", 0.3, 0.15), 0.02, "integral"),
        "lag_noisy": (condition("lag, noise", 0.3, 0.15, pose_noise=noise), 0.02, "integral"),
        "noisy": (condition("noise", pose_noise=noise), 0.03, "integral"),
        "very_noisy": (
            condition("much noise", pose_noise=tuple(2.5 * n for n in noise)),
            0.03,
            "integral",
        ),
        "turning": (condition("turning", turning_point=(0.05, 0.02)), 0.03, "integral"),
        "turning_back": (condition("turning back", turning_point=(-0.04, 0.0)), 0.03, "integral"),
    }
    models = {
        name: lesson.learn(slip, method, 60, 200)
        for name, (lesson, slip, method) in lessons.items()
    }
    models["nominal"], models["fast"] = kl.nominal_unicycle(0.1), kl.nominal_unicycle(0.05)
    models["skid"] = kl.fit(
        kmpc_lab.generate_dataset(
            kmpc_lab.DifferentialDrive(0.02, 1, 0.5), episodes=60, steps=200, dt=0.1, seed=2
        )
    )
    return models
