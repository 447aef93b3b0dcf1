"""``kmpc study table1``: the paper's table 1, its controllers beside ours, on any executor."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from kmpc_lab.sim.closed_loop import drive
from kmpc_lab.studies.contenders import TABLE_1_CONTENDERS, Contender
from kmpc_lab.studies.executors import gather
from kmpc_lab.studies.paper_table import Cell
from kmpc_lab.studies.records import Record, RecordFile
from kmpc_lab.studies.training import DT, LAMBDAS, REPORTING_SEED, TRAINING, Teacher, train
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

Progress = Callable[[int, int], None]
"""Called with tasks done and tasks in all."""
CellKey = tuple[str, float | None, float, int, str]

STOP_NORM = 1e-2
"""The paper's end of a run: ``|x - x_ref|`` over the whole state."""
GENERAL_FROM, GENERAL_TO = 0.1, (0.15, 0.2)
"""Slip of the training, and slips that are driven at, where these differ."""


@dataclass(frozen=True)
class TableLesson:
    """What a model of the table is learned from."""

    slip: float
    method: Method

    def learn(self, episodes: int, steps: int) -> KoopmanModel:
        """Learn as the paper does."""
        return train(self.slip, self.method, episodes, steps)


def run_trials(
    spec: Contender,
    model: KoopmanModel,
    scenario: Scenario,
    seeds: Sequence[int],
    stop_norm: float,
) -> list[dict[str, Any]]:
    """Drive one scenario with each seed; numbers only, so that a worker can send them back."""
    results = []
    controller = spec.build(model, scenario)
    for seed in seeds:
        controller.reset()
        run = drive(controller, replace(scenario, seed=seed), dt=DT, stop_norm=stop_norm)
        results.append({**run.summary(), "seed": seed, "arrival_s": run.arrival})
    return results


def table1(
    scenario: Scenario,
    executor: Executor,
    trials: int = 5,
    controllers: Sequence[Contender] = TABLE_1_CONTENDERS,
    lambdas: Sequence[float] = LAMBDAS,
    training: Mapping[str, int] = TRAINING,
    progress: Progress = lambda done, total: None,
    records: str | Path | None = None,
) -> list[Cell]:
    """Run the paper's table 1 on a map.

    Train and drive at each slip, then train at 0.1 and drive at 0.15 and 0.2.

    Parameters
    ----------
    scenario : Scenario
        Map; its slip and seed are replaced.
    executor : Executor
        Does the work; its workers must be able to import this package.
    trials : int
        Runs for each slip and controller.
    controllers : sequence of Contender
        Rows.
    lambdas : sequence of float
        Slips.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    progress : callable
        Called as tasks finish.
    records : path, optional
        JSON-lines file to which every cell is added, and from which those already driven are taken.

    Returns
    -------
    list of Cell
        By controller, then slip; generalisation last.

    Raises
    ------
    DataError
        For a records file that is not this study's.
    """
    driven = [(spec, slip, slip) for spec in controllers for slip in lambdas]
    driven += [
        (spec, GENERAL_FROM, slip) for spec in controllers if spec.fit for slip in GENERAL_TO
    ]
    place = _digest(scenario)
    file = RecordFile(records, _key, "a cell of table 1")
    wanted: dict[CellKey, tuple[Contender, TableLesson | None, float]] = {}
    for spec, trained, slip in driven:
        lesson = TableLesson(trained, spec.fit) if spec.fit else None
        at = None if lesson is None else float(trained)
        wanted[spec.label, at, float(slip), trials, place] = (spec, lesson, slip)
    done = {key: record for key, record in file.read().items() if key in wanted}
    missing = [key for key in wanted if key not in done]
    teacher = Teacher(executor, training)
    lessons = teacher.new(wanted[key][1] for key in missing)
    total, finished = len(lessons) + len(missing), 0

    def count() -> None:
        nonlocal finished
        finished += 1
        progress(finished, total)

    def keep(key: CellKey, runs: list[dict[str, Any]]) -> None:
        cell = Cell(key[0], key[1], key[2], tuple(runs))
        done[key] = {**cell.as_dict(), "map": place}
        file.add([done[key]])
        count()

    teacher.learn(lessons, count)
    seeds = [REPORTING_SEED + i for i in range(trials)]
    jobs = {}
    for key in missing:
        spec, lesson, slip = wanted[key]
        model, floor = teacher.model(lesson), replace(scenario, slip=slip)
        jobs[executor.submit(run_trials, spec, model, floor, seeds, STOP_NORM)] = partial(keep, key)
    gather(jobs)
    return [Cell.from_dict(done[key]) for key in wanted]


def _key(record: Record) -> CellKey:
    """Identity of a cell: controller, slip of the training, slip, trials, and map."""
    trained = None if record["trained_at"] is None else float(record["trained_at"])
    size = int(record["trials"])
    return str(record["controller"]), trained, float(record["slip"]), size, str(record["map"])


def _digest(scenario: Scenario) -> str:
    """Name of a map by all that stands in it, whatever its file is called."""
    text = replace(scenario, slip=0.0, seed=0).to_toml()
    return hashlib.sha256(text.encode()).hexdigest()[:16]
