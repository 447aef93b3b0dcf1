"""Margins of one robot with what its drift detector has seen, and plans to ask about."""

from __future__ import annotations

from typing import Any

import numpy as np
from reference import kernels

import kmpc_lab
import kmpc_lite as kl
from kmpc_lite.control.estimate.innovation import InnovationState
from kmpc_lite.control.kernels.records import things_of
from kmpc_lite.control.margins import FeltNoise, Margins
from kmpc_lite.control.options import MarginOptions, StopOptions
from kmpc_lite.control.plan import Task
from kmpc_lite.control.safe_motion import SafeMotion, SafeMotions
from kmpc_lite.control.world.scene import Surroundings

PROBLEM = kl.NavigationProblem()
CIRCLES = np.array([[1.0, 0.0, 0.2, 0.0, 0.0]])


class Wary:
    """Asks margins with a drift state of its own."""

    def __init__(
        self,
        model: kl.KoopmanModel,
        problem: kl.NavigationProblem = PROBLEM,
        adapted: bool = False,
        **options: Any,
    ) -> None:
        self.problem, self.options, self.model = problem, MarginOptions(**options), model
        self.drift, self.of = (
            InnovationState(),
            Margins(model, problem, self.options, adapted=adapted),
        )

    @property
    def inflation(self) -> float:
        return self.of.expected_errors.inflation(self.drift)

    @property
    def quantile(self) -> float:
        return self.of.noise.quantile

    @property
    def widest(self) -> float:
        return self.felt.widest

    @property
    def felt(self) -> FeltNoise:
        return self.of.felt(self.drift)

    def reset(self) -> None:
        self.drift = InnovationState()

    def update(self, model: kl.KoopmanModel, adapted: bool = False) -> None:
        self.model = model
        before, self.of = self.of, Margins(model, self.problem, self.options, adapted=adapted)
        self.of.expected_errors.carry_over(self.drift, before.expected_errors)

    def observe(self, error: np.ndarray, heading: float, command: np.ndarray) -> None:
        self.of.expected_errors.judge(self.drift, error, heading, command, False)

    def margins(self, *plan: Any, **more: Any) -> np.ndarray:
        return self.of.of_plan(self.felt, *plan, **more)

    def margin(self, v: float, omega: float) -> float:
        """Of a motion that lasts a period."""
        dt = self.model.dt
        way = np.array([dt * v]), np.array([dt * omega])
        return float(self.of.of_motions(self.felt, *way)[0])

    def error(self, v: float, omega: float) -> float:
        """Of a command, towards whatever lies where it errs most."""
        command, anywhere = np.array([(v, omega)]), directions_around(16)
        return float(self.of.of_commands(self.felt, command, anywhere).max())

    def motion(self, here: np.ndarray, command: np.ndarray, circles: np.ndarray) -> SafeMotion:
        """What is driven of a steady plan."""
        inputs = np.tile(command, (self.problem.horizon, 1))
        none = np.zeros((self.model.history, 2))
        states = self.model.rollout(here, inputs, none)
        around = Surroundings(things_of(circles))
        task = Task(self.model, none, np.zeros(2), around, self.of, self.felt)
        return SafeMotions(self.problem, StopOptions()).find(states, inputs, task)

    def speed_share(self, here: np.ndarray, command: np.ndarray, circles: np.ndarray) -> float:
        """Share of its speed that a command keeps."""
        motion = self.motion(here, command, circles)
        assert motion.commands is not None
        return float(motion.inputs[0, 0] / command[0])


def covariances(felt: FeltNoise, lin: Any, states: np.ndarray, inputs: np.ndarray) -> np.ndarray:
    """Covariances (N, 2, 2) of the position at stages 1 to N [m^2]."""
    return kernels.covariances(felt.tube, lin.A, states, inputs)[:, :2, :2]


def slipping(slip: float, seed: int = 0) -> kl.KoopmanModel:
    """A model learned on a floor that slips, with calibrated quantiles."""
    plant = kmpc_lab.DifferentialDrive(slip, seed=seed)
    data = kmpc_lab.generate_dataset(plant, episodes=60, steps=400, dt=0.1, seed=seed + 1)
    train, held_out = data.split(0.5)
    return kl.with_quantiles(kl.fit(train), held_out)


def plan(
    model: kl.KoopmanModel, v: float = 0.6, omega: float = 0.3, n: int = 20, heading: float = 0.4
) -> tuple[Any, np.ndarray, np.ndarray]:
    """Linearisation, states and commands of a steady drive."""
    inputs = np.tile([v, omega], (n, 1))
    states = model.rollout((0.2, -0.1, heading), inputs)
    return model.linearize(states[:-1], inputs), states, inputs


def directions_around(count: int) -> np.ndarray:
    """Slopes (count, 3) of clearances from things all around."""
    angle = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
    return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=-1)


def of_noise(model: kl.KoopmanModel, **options: Any) -> Wary:
    """Margins that come from the learned noise alone."""
    return Wary(model, headway=0.0, **options)


def directions(n: int, slots: int, seed: int = 0) -> np.ndarray:
    """Unit vectors (n, slots, 2)."""
    angle = np.random.default_rng(seed).uniform(-np.pi, np.pi, (n, slots))
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)
