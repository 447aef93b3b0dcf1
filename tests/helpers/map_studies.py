"""Studies of few maps, driven by controllers without a model."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from executors import Inline
from guided import GuideInUse
from scripted import Scripted

import kmpc_lite as kl
from kmpc_lab.sim.closed_loop import Steps
from kmpc_lab.studies.random_maps import maps_study
from kmpc_lab.studies.records import Work
from kmpc_lite.learn.regression import Method
from kmpc_lite.scenario.files import Scenario

SMALL = {"episodes": 6, "steps": 30}


class Follower:
    """Drives to where the guide's reference will be in 0.3 s; no model."""

    def __init__(self, problem: kl.NavigationProblem) -> None:
        self.guide, self.problem = GuideInUse(problem), problem

    def step(self, x: Any, goal: Any, obstacles: Any = ()) -> kl.Plan:
        pose = np.array(x, dtype=float)
        pose[2] -= 2 * np.pi * np.round(pose[2] / (2 * np.pi))
        target = self.guide.reference(pose, np.asarray(goal), obstacles).states[2]
        error = target - pose
        ahead = np.cos(pose[2]) * error[0] + np.sin(pose[2]) * error[1]
        aside = np.cos(pose[2]) * error[1] - np.sin(pose[2]) * error[0]
        u_min, u_max, _, _ = self.problem.bounds
        command = np.clip(
            [ahead / 0.3, (error[2] + 2 * np.sign(ahead) * aside) / 0.3], u_min, u_max
        )
        return kl.Plan(
            command,
            np.tile(pose, (4, 1)),
            np.tile(command, (3, 1)),
            kl.PlanStatus.SOLVED,
            1,
            {"total": 2e-3},
        )


@dataclass(frozen=True)
class Spec:
    """A controller without a model; can be sent to another process."""

    label: str
    kind: str
    fit: Method | None = None
    simulate_words: tuple[str, ...] | None = None

    def build(self, model: kl.KoopmanModel, scenario: Scenario) -> Steps:
        if self.kind == "follow":
            return Follower(replace(scenario.problem(), margin=0.04))
        return Scripted((0.0, 0.0) if self.kind == "stand" else (0.6, 0.0))


FOLLOW, STAND, RAM = Spec("follow", "follow"), Spec("stand", "stand"), Spec("ram", "ram")


def study(executor: Executor | None = None, **options: Any) -> list[dict[str, Any]]:
    values: dict[str, Any] = {
        "specs": [FOLLOW, STAND, RAM],
        "slips": (0.0, 0.1),
        "maps": 2,
        "first_seed": 100,
        "training": SMALL,
    }
    values.update(options)
    how = {name: values.pop(name) for name in ("progress", "records") if name in values}
    work = Work(executor or Inline(), **how)
    return maps_study(values.pop("specs"), work, **values)
