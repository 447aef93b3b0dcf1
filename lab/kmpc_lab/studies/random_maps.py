"""``kmpc study maps`` and its sisters: drives over random maps on any executor.

A study drives maps x conditions x slips x seeds x controllers, on any
`concurrent.futures.Executor`. Every drive is one line of a JSON file; a study that was interrupted
goes on where it ended.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Protocol

import numpy as np

from kmpc_lab.sim.closed_loop import Outcome, Run, Steps, drive
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.conditions import PLAIN, Condition, MapLesson
from kmpc_lab.studies.failures import Driven, check_folder, failed, write_failures
from kmpc_lab.studies.records import Job, Record, Work
from kmpc_lab.studies.tables import Key, drive_key
from kmpc_lab.studies.training import DT, LAMBDAS, REPORTING_SEED, TRAINING, Teacher
from kmpc_lite.geometry import distances
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

SETTLE = 1.0
"""How long a robot must stay within the tolerances for a drive to end [s]."""
CHUNK = 10
"""Drives of one task."""


class Spec(Driven, Protocol):
    """What a worker needs to build a controller, as `Contender` has it."""

    @property
    def label(self) -> str:
        """Name in tables and files."""
        ...

    @property
    def fit(self) -> Method | None:
        """How the model is learned; None is the nominal unicycle."""
        ...

    def build(self, model: KoopmanModel, scenario: Scenario) -> Steps:
        """Make the controller for a scenario."""
        ...


@dataclass(frozen=True)
class MapDrives:
    """One controller under one condition on one family at one slip: a drive for every seed."""

    spec: Spec
    condition: Condition
    family: str
    slip: float
    trained_at: float | None
    """Slip of the training data; None for the nominal unicycle."""

    def key(self, seed: int) -> Key:
        """Identity of a drive, as `drive_key` reads it from a record."""
        words = self.spec.label, self.condition.name, self.family
        return *words, self.trained_at, float(self.slip), seed

    @property
    def lesson(self) -> MapLesson | None:
        """What its model is learned from."""
        if self.spec.fit is None or self.trained_at is None:
            return None
        return MapLesson(self.condition.log, self.trained_at, self.spec.fit)


def measure(
    run: Run, family: str, controller: str, trained_at: float | None, condition: Condition = PLAIN
) -> Record:
    """Plain numbers of one drive: what a table is made of."""
    scenario, times = run.scenario, 1e3 * run.step_times
    near = distances(run.states, np.array(scenario.goal)) <= scenario.tolerance
    return {
        "controller": controller,
        "family": family,
        "condition": condition.name,
        "trained_at": trained_at,
        "slip": scenario.slip,
        "seed": scenario.seed,
        "collision_s": run.duration if run.outcome is Outcome.COLLISION else None,
        "position_s": float(np.argmax(near) * run.dt) if near.any() else None,
        "pose_s": run.arrival,
        "settled_s": run.duration if run.outcome is Outcome.REACHED else None,
        "clearance_m": run.clearance if np.isfinite(run.clearance) else None,
        "position_error_m": run.position_error,
        "heading_error_rad": run.heading_error,
        "step_p50_ms": float(np.median(times)),
        "step_max_ms": float(times.max()),
    }


def drive_maps(
    spec: Spec,
    model: KoopmanModel,
    trained_at: float | None,
    condition: Condition,
    family: str,
    slip: float,
    seeds: Sequence[int],
) -> list[Record]:
    """Drive one family's maps, one for each seed; this is what a worker does."""
    records = []
    for seed in seeds:
        scenario = condition.apply(random_map(family, seed, slip))
        controller = spec.build(model, scenario)
        run = drive(controller, scenario, dt=DT, settle=SETTLE)
        records.append(measure(run, family, spec.label, trained_at, condition))
    return records


def maps_study(
    specs: Sequence[Spec],
    work: Work,
    families: Sequence[str] = ("open",),
    slips: Sequence[float] = LAMBDAS,
    maps: int = 100,
    first_seed: int = REPORTING_SEED,
    failures: str | Path | None = None,
    training: Mapping[str, int] = TRAINING,
    trained_at: float | None = None,
    conditions: Sequence[Condition] = (PLAIN,),
) -> list[Record]:
    """Drive every controller through the same maps, at every slip.

    Parameters
    ----------
    specs : sequence of Spec
        Controllers.
    work : Work
        Does it.
    families : sequence of str
        Of `maps.FAMILIES`.
    slips : sequence of float
        Of the plant.
    maps : int
        Maps of each family; the same ones for every controller and slip.
    first_seed : int
        The first map's; figures that are reported come from `REPORTING_SEED` and above, anything is
        tuned below it.
    failures : path, optional
        Folder for scenario files of the drives that failed.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    trained_at : float, optional
        Slip at which models are learned; each at the slip that it drives at if not given.
    conditions : sequence of Condition
        What robots, poses and floors are like beside the slip.

    Returns
    -------
    list of dict
        One record for each drive, by controller, condition, family, slip and seed.

    Raises
    ------
    DataError
        For a records file that is not this study's.
    OSError
        If records or failures cannot be written; before anything is driven.
    """
    if failures is not None:
        check_folder(failures)
    cells = _cells(specs, conditions, families, slips, trained_at)
    seeds = range(first_seed, first_seed + maps)
    wanted = {cell.key(seed): cell for cell in cells for seed in seeds}
    teacher = Teacher(work.executor, training)

    def jobs(missing: Sequence[Key]) -> Iterator[Job]:
        left = frozenset(missing)
        for cell in cells:
            own = [seed for seed in seeds if cell.key(seed) in left]
            where = cell.trained_at, cell.condition, cell.family, cell.slip
            for i in range(0, len(own), CHUNK):
                task = cell.spec, teacher.model(cell.lesson), *where, own[i : i + CHUNK]
                yield work.executor.submit(drive_maps, *task), list

    def lesson(key: Key) -> MapLesson | None:
        return wanted[key].lesson

    what = "a drive of a maps study"
    results = work.finish(wanted, drive_key, what, jobs, teacher, lesson)
    if failures is not None:
        lost = [(r, wanted[drive_key(r)]) for r in results if failed(r)]
        teacher.learn(cell.lesson for _, cell in lost)
        write_failures(
            ((r, c.spec, c.condition, teacher.model(c.lesson)) for r, c in lost), failures
        )
    return results


def _cells(
    specs: Sequence[Spec],
    conditions: Sequence[Condition],
    families: Sequence[str],
    slips: Sequence[float],
    trained_at: float | None,
) -> list[MapDrives]:
    """Everything that is driven, but for the seeds."""
    cells = []
    for spec, condition, family, slip in product(specs, conditions, families, slips):
        at = float(slip if trained_at is None else trained_at)
        cells.append(MapDrives(spec, condition, family, slip, None if spec.fit is None else at))
    return cells
