"""How well a controller's model knows a changed floor, beside a model that was learned there."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from kmpc_lab.sim.closed_loop import Steps
from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lab.studies.training import DT, TRAINING_SEED
from kmpc_lite.control.controller import Controller
from kmpc_lite.control.plan import Plan
from kmpc_lite.learn.dataset import Dataset
from kmpc_lite.learn.evaluation import evaluate
from kmpc_lite.learn.fitting import fit
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario
from kmpc_lite.scenario.values import Floor

TIME = 5.0
"""Time of motion after which the model is judged [s]."""
MOTION = (0.05, 0.05)
"""A command below which the robot does not move to speak of [m/s, rad/s]."""
FASTEST = (0.6, 0.785)
"""Commands of the drives that the models are judged on (m/s, rad/s): the controller's."""


class FloorWatch:
    """A controller's `step` that keeps its model after `TIME` of motion on the last floor.

    A drive that ends earlier keeps the model of its end.

    Parameters
    ----------
    controller : Steps
        Ours; of any other nothing is noted.
    scenario : Scenario
        Its floors.
    dt : float
        Period [s].
    """

    def __init__(self, controller: Steps, scenario: Scenario, dt: float) -> None:
        self._controller, self._floor, self._dt = controller, scenario.floors[-1], dt
        self._steps = 0
        self.motion = 0.0
        """On the last floor [s]."""
        self.model: KoopmanModel | None = None

    def step(self, x: ArrayLike, goal: ArrayLike, obstacles: ArrayLike = ()) -> Plan:
        """Plan as the controller does."""
        plan = self._controller.step(x, goal, obstacles)
        if self.motion < TIME and isinstance(self._controller, Controller):
            self.model = self._controller.model
        if (
            self._steps * self._dt >= self._floor.time - 1e-9
            and (np.abs(plan.command) > MOTION).any()
        ):
            self.motion += self._dt
        self._steps += 1
        return plan

    def error_ratio(self) -> float | None:
        """Largest ratio of the model's errors to a fresh fit's; None if there is no model.

        Errors are those along, across and of heading after 1 s.
        """
        if self.model is None or not self.motion:
            return None
        drives, fresh = _truth(self._floor)
        errors = np.array(evaluate(self.model, drives, 1.0, stride=10).multi_step)
        return float((errors / fresh).max())


@lru_cache(maxsize=8)
def _truth(floor: Floor) -> tuple[Dataset, np.ndarray]:
    """Drives on a floor, and the errors (3,) there of a model that was learned on it."""
    plant = DifferentialDrive(floor.slip, TRAINING_SEED + 4, floor.turn_gain)
    model = fit(generate_dataset(plant, 100, 300, DT, TRAINING_SEED + 5))
    drives = generate_dataset(plant, 60, 60, DT, TRAINING_SEED + 6, u_max=FASTEST)
    # without slip a fit is exact: an error below a millimetre, or a milliradian, is none
    return drives, np.maximum(evaluate(model, drives, 1.0, stride=10).multi_step, 1e-3)
