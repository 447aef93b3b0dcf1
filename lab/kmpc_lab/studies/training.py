"""Models that studies drive with, learned as the paper learns; each is learned once."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from functools import partial
from typing import Protocol

from kmpc_lab.sim.plants.robots import DifferentialDrive, generate_dataset
from kmpc_lab.studies.executors import gather
from kmpc_lite.learn.calibration import with_quantiles
from kmpc_lite.learn.fitting import fit
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.model.nominal import nominal_unicycle

DT = 0.1
"""Sampling period of all studies [s]."""
LAMBDAS = (0.0, 0.01, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2)
"""Slips of the paper's table 1."""
TRAINING = {"episodes": 1000, "steps": 1000}
"""Drives that the paper learns from, and periods of each."""
TRAINING_SEED, REPORTING_SEED = 1_000, 500_000
"""Seeds of training data, and of the trials that are reported; nothing is tuned on the latter."""


def train(slip: float, method: Method, episodes: int, steps: int) -> KoopmanModel:
    """Learn as the paper does, at one slip; quantiles for margins come from drives of their own."""
    plant = DifferentialDrive(slip, seed=TRAINING_SEED)
    model = fit(generate_dataset(plant, episodes, steps, DT, seed=TRAINING_SEED + 1), method=method)
    if method == "edmdc":
        return model
    held = generate_dataset(
        DifferentialDrive(slip, seed=TRAINING_SEED + 2),
        max(episodes // 5, 10),
        max(steps // 5, 100),
        DT,
        seed=TRAINING_SEED + 3,
    )
    return with_quantiles(model, held)


class Lesson(Protocol):
    """What one model is learned from; equal lessons give the same model."""

    def learn(self, episodes: int, steps: int) -> KoopmanModel:
        """Make the data, and fit."""
        ...

    def __hash__(self) -> int: ...


class Teacher:
    """Learns models side by side on an executor, each lesson once, and keeps them.

    Parameters
    ----------
    executor : Executor
        Does the work.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    """

    def __init__(self, executor: Executor, training: Mapping[str, int] = TRAINING) -> None:
        self._executor, self._training = executor, training
        self._models: dict[Lesson, KoopmanModel] = {}

    def new(self, lessons: Iterable[Lesson | None]) -> list[Lesson]:
        """Lessons among these that are not learned yet, each once."""
        return [
            lesson
            for lesson in dict.fromkeys(lessons)
            if lesson is not None and lesson not in self._models
        ]

    def learn(
        self, lessons: Iterable[Lesson | None], done: Callable[[], None] = lambda: None
    ) -> None:
        """Learn what is not learned yet; `done` is called after each."""
        jobs = {
            self._executor.submit(lesson.learn, **self._training): partial(self._keep, lesson, done)
            for lesson in self.new(lessons)
        }
        gather(jobs)

    def _keep(self, lesson: Lesson, done: Callable[[], None], model: KoopmanModel) -> None:
        self._models[lesson] = model
        done()

    def model(self, lesson: Lesson | None) -> KoopmanModel:
        """Model of a lesson that was learned; the nominal unicycle for None."""
        return nominal_unicycle(DT) if lesson is None else self._models[lesson]
