"""``kmpc study maps`` and its sisters: drives over random maps on any executor.

A study drives maps x conditions x slips x seeds x controllers, on any
`concurrent.futures.Executor`.

Every drive is one line of a JSON file; a study that was interrupted goes on where it ended. What
failed is written as a scenario file that replays it, beside the model that was driven.
"""

from __future__ import annotations

import errno
import json
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Protocol

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel, nominal_unicycle
from kmpc_lite.sim.closed_loop import Outcome, Run, Steps, drive
from kmpc_lite.sim.maps.families import random_map
from kmpc_lite.sim.scenario.files import Scenario
from kmpc_lite.studies.conditions import PLAIN, Condition
from kmpc_lite.studies.floor_watch import FloorWatch
from kmpc_lite.studies.table1 import DT, LAMBDAS, REPORTING_SEED, TRAINING, arrival_time
from kmpc_lite.studies.tables import Key, Record, drive_key

SETTLE = 1.0
"""How long a robot must stay within the tolerances for a drive to end [s]."""
CHUNK = 10
"""Drives of one task."""
Lesson = tuple[Condition, float, Method]
"""What a model is learned from: condition, slip, method."""


class Spec(Protocol):
    """What a worker needs to build a controller; `study.ControllerSpec` is one."""

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


def measure(
    run: Run, family: str, controller: str, trained_at: float | None, condition: Condition = PLAIN
) -> Record:
    """Plain numbers of one drive: what a table is made of."""
    reached = (
        np.hypot(*(run.states[:, :2] - np.array(run.scenario.goal[:2])).T) <= run.scenario.tolerance
    )
    times = 1e3 * run.step_times
    return {
        "controller": controller,
        "family": family,
        "condition": condition.name,
        "trained_at": trained_at,
        "slip": run.scenario.slip,
        "seed": run.scenario.seed,
        "collision_s": run.duration if run.outcome is Outcome.COLLISION else None,
        "position_s": float(np.argmax(reached) * run.dt) if reached.any() else None,
        "pose_s": arrival_time(run),
        "settled_s": run.duration if run.outcome is Outcome.REACHED else None,
        "clearance_m": run.clearance if np.isfinite(run.clearance) else None,
        "position_error_m": run.position_error,
        "heading_error_rad": run.heading_error,
        "step_p50_ms": float(np.median(times)),
        "step_max_ms": float(times.max()),
    }


def failed(record: Record) -> bool:
    """Whether a drive collided, or never came to the goal's pose."""
    return record["collision_s"] is not None or record["pose_s"] is None


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
        watch = FloorWatch(controller, scenario, DT) if condition.floors else None
        run = drive(watch or controller, scenario, dt=DT, settle=SETTLE)
        record = measure(run, family, spec.label, trained_at, condition)
        records.append(record if watch is None else {**record, "error_ratio": watch.error_ratio()})
    return records


def maps_study(
    specs: Sequence[Spec],
    executor: Executor,
    families: Sequence[str] = ("open",),
    slips: Sequence[float] = LAMBDAS,
    maps: int = 100,
    first_seed: int = REPORTING_SEED,
    records: str | Path | None = None,
    failures: str | Path | None = None,
    training: Mapping[str, int] = TRAINING,
    trained_at: float | None = None,
    conditions: Sequence[Condition] = (PLAIN,),
    progress: Callable[[int, int], None] = lambda done, total: None,
) -> list[Record]:
    """Drive every controller through the same maps, at every slip.

    Parameters
    ----------
    specs : sequence of Spec
        Controllers.
    executor : Executor
        Does the work; its workers must be able to import this package.
    families : sequence of str
        Of `maps.FAMILIES`.
    slips : sequence of float
        Of the plant.
    maps : int
        Maps of each family; the same ones for every controller and slip.
    first_seed : int
        The first map's; figures that are reported come from `REPORTING_SEED` and above, anything is
        tuned below it.
    records : path, optional
        JSON-lines file to which every drive is added, and from which those already driven are
        taken.
    failures : path, optional
        Folder for scenario files of the drives that failed.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    trained_at : float, optional
        Slip at which models are learned; each at the slip that it drives at where not given.
    conditions : sequence of Condition
        What robots, poses and floors are like beside the slip.
    progress : callable
        Called with drives done and drives in all.

    Returns
    -------
    list of dict
        One record for each drive, by controller, condition, family, slip and seed.

    Raises
    ------
    DataError
        For a records file that is not this study's.
    OSError
        Where records or failures cannot be written; before anything is driven.
    """
    if failures is not None:
        check_folder(failures)
    if records is not None:
        Path(records).open("a").close()
    seeds = range(first_seed, first_seed + maps)

    def learned_at(spec: Spec, slip: float) -> float | None:
        return None if spec.fit is None else float(slip if trained_at is None else trained_at)

    def key(spec: Spec, condition: Condition, family: str, slip: float, seed: int) -> Key:
        return spec.label, condition.name, family, learned_at(spec, slip), float(slip), seed

    def lesson(spec: Spec, condition: Condition, slip: float) -> Lesson | None:
        trained = learned_at(spec, slip)
        return None if spec.fit is None or trained is None else (condition.log, trained, spec.fit)

    cells = [
        (spec, condition, family, slip)
        for spec in specs
        for condition in conditions
        for family in families
        for slip in slips
    ]
    wanted = {key(*cell, seed): cell for cell in cells for seed in seeds}
    done = (
        {drive_key(r): r for r in _read(records) if drive_key(r) in wanted}
        if records is not None
        else {}
    )
    progress(len(done), len(wanted))
    missing: list[tuple[Spec, Condition, str, float, list[int]]] = []
    for cell in cells:
        left = [seed for seed in seeds if key(*cell, seed) not in done]
        missing += [(*cell, left[i : i + CHUNK]) for i in range(0, len(left), CHUNK)]
    models: dict[Lesson, KoopmanModel] = {}

    def learn(cells: Iterable[tuple[Spec, Condition, float]]) -> None:
        """Learn what is not learned yet, side by side."""
        needed = dict.fromkeys(
            found for cell in cells if (found := lesson(*cell)) is not None and found not in models
        )
        lessons = {(c, s, m): executor.submit(c.learn, s, m, **training) for c, s, m in needed}
        models.update((one, future.result()) for one, future in lessons.items())

    def model_of(spec: Spec, condition: Condition, slip: float) -> KoopmanModel:
        found = lesson(spec, condition, slip)
        return nominal_unicycle(DT) if found is None else models[found]

    learn((spec, condition, slip) for spec, condition, _, slip, _ in missing)
    jobs = []
    for spec, condition, family, slip, chunk in missing:
        model, trained = model_of(spec, condition, slip), learned_at(spec, slip)
        jobs.append(
            executor.submit(drive_maps, spec, model, trained, condition, family, slip, chunk)
        )
    first_error: BaseException | None = None
    for job in as_completed(jobs):
        # what else was driven is kept before a worker's error ends the study
        if (error := job.exception()) is not None:
            first_error = first_error or error
            continue
        found = job.result()
        done.update((drive_key(r), r) for r in found)
        if records is not None:
            _append(records, found)
        progress(len(done), len(wanted))
    if first_error is not None:
        raise first_error
    results = [done[k] for k in (key(*cell, seed) for cell in cells for seed in seeds)]
    if failures is not None:
        lost = [(r, wanted[drive_key(r)]) for r in results if failed(r)]
        learn((spec, condition, slip) for _, (spec, condition, _, slip) in lost)
        write_failures(
            (
                (r, condition, model_of(spec, condition, slip))
                for r, (spec, condition, _, slip) in lost
            ),
            failures,
        )
    return results


def check_folder(folder: str | Path) -> None:
    """Raise OSError where a folder cannot be made or written to, before hours of driving."""
    place = Path(folder).absolute()
    while not place.exists():
        place = place.parent
    if not place.is_dir():
        raise NotADirectoryError(errno.ENOTDIR, os.strerror(errno.ENOTDIR), str(place))
    if not os.access(place, os.W_OK | os.X_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(place))


def write_failures(
    drives: Iterable[tuple[Record, Condition, KoopmanModel]], folder: str | Path
) -> list[Path]:
    """Write a scenario file for every drive, and the model that was driven.

    The first line of each file says how to drive it again.
    """
    target = Path(folder)
    paths = []
    for record, condition, model in drives:
        scenario = condition.apply(random_map(record["family"], record["seed"], record["slip"]))
        what = "collision" if record["collision_s"] is not None else "not there"
        target.mkdir(parents=True, exist_ok=True)
        trained = "nominal" if record["trained_at"] is None else f"{record['trained_at']:g}"
        learned = (
            target
            / f"{_file_name('model', record['condition'], trained, model.info['method'])}.npz"
        )
        if not learned.exists():
            model.save(learned)
        path = (
            target
            / f"{scenario.name}-slip{record['slip']:g}-{_file_name(record['controller'])}.toml"
        )
        switch = " --no-adaptation" if "no adaptation" in record["controller"] else ""
        path.write_text(
            f"# {record['controller']}: {what}; kmpc simulate --scenario {path.name} --model "
            f"{learned.name}{switch}\n{scenario.to_toml()}",
            encoding="utf-8",
        )
        paths.append(path)
    return paths


def _file_name(*words: str) -> str:
    """Words as a part of a file's name."""
    return "-".join("".join(c if c.isalnum() or c == "." else " " for c in " ".join(words)).split())


def _append(path: str | Path, records: Sequence[Record]) -> None:
    with Path(path).open("a", encoding="utf-8") as file:
        file.writelines(json.dumps(r) + "\n" for r in records)


def _read(path: str | Path) -> list[Record]:
    """Records of an earlier run; a last line that was cut off is dropped, from the file too."""
    source = Path(path)
    if not source.exists():
        return []
    text = source.read_text(encoding="utf-8")
    whole, _, cut_off = text.rpartition("\n")
    if cut_off:
        source.write_text(whole + "\n" if whole else "", encoding="utf-8")
    records = []
    for number, line in enumerate(whole.splitlines(), 1):
        try:
            record = json.loads(line)
            drive_key(record)
        except (ValueError, KeyError, TypeError) as error:
            raise DataError(
                f"{source}: line {number}: expected a drive of a maps study, got {line[:60]!r}"
            ) from error
        records.append(record)
    return records
