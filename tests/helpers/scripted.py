"""Controllers that do as a test says, to test what drives them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import kmpc_lite as kl
from kmpc_lite.scenario.files import Scenario


class Scripted:
    """Sends given commands, one after another, the last for ever; remembers what it was asked."""

    def __init__(self, *commands: Sequence[float], seconds: float = 1e-3) -> None:
        self.commands, self.seconds = commands, seconds
        self.asked: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
        self.resets = 0

    def step(self, x: Any, goal: Any, obstacles: Any = ()) -> kl.Plan:
        command = np.array(self.commands[min(len(self.asked), len(self.commands) - 1)], dtype=float)
        self.asked.append((np.array(x), np.array(goal), np.array(obstacles)))
        states, inputs = np.tile(x, (4, 1)), np.tile(command, (3, 1))
        return kl.Plan(command, states, inputs, kl.PlanStatus.SOLVED, 1, {"total": self.seconds})

    def reset(self) -> None:
        self.resets += 1
        self.asked.clear()


def field(**changes: Any) -> Scenario:
    """A wide empty field; the robot looks east, its goal is one metre ahead."""
    values: dict[str, Any] = {
        "name": "field",
        "bounds": (-5.0, -5.0, 5.0, 5.0),
        "circles": (),
        "radius": 0.1,
        "start": (0.0, 0.0, 0.0),
        "goal": (1.0, 0.0, 0.0),
        "timeout": 5.0,
        "tolerance": 0.06,
        "heading_tolerance": 0.1,
    }
    return Scenario(**{**values, **changes})
