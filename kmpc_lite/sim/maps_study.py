"""``kmpc study maps``: random maps x slips x seeds x controllers, on any `concurrent.futures.Executor`.

Every drive is one line of a JSON file; a study that was interrupted goes on where it ended. What failed is written as a
scenario file that replays it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import Executor, as_completed
from pathlib import Path
from typing import Protocol

import numpy as np

from kmpc_lite.errors import DataError
from kmpc_lite.learn.regression import Method
from kmpc_lite.model import KoopmanModel, nominal_unicycle
from kmpc_lite.sim.closed_loop import Outcome, Run, Steps, drive
from kmpc_lite.sim.maps import random_map
from kmpc_lite.sim.maps_table import Key, Record, drive_key
from kmpc_lite.sim.scenario import Scenario
from kmpc_lite.sim.study import DT, LAMBDAS, REPORTING_SEED, TRAINING, arrival_time, train

SETTLE = 1.0
"""How long a robot must stay within the tolerances for a drive to end [s]."""
CHUNK = 10
"""Drives of one task."""


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


def measure(run: Run, family: str, controller: str, trained_at: float | None) -> Record:
    """Plain numbers of one drive: what a table is made of."""
    reached = np.hypot(*(run.states[:, :2] - np.array(run.scenario.goal[:2])).T) <= run.scenario.tolerance
    times = 1e3 * run.step_times
    return {
        "controller": controller,
        "family": family,
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


def drive_maps(spec: Spec, model: KoopmanModel, trained_at: float | None, family: str, slip: float, seeds: Sequence[int]) -> list[Record]:
    """Drive one family's maps, one for each seed; this is what a worker does."""
    records = []
    for seed in seeds:
        scenario = random_map(family, seed, slip)
        run = drive(spec.build(model, scenario), scenario, dt=DT, settle=SETTLE)
        records.append(measure(run, family, spec.label, trained_at))
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
        The first map's; figures that are reported come from `REPORTING_SEED` and above, anything is tuned below it.
    records : path, optional
        JSON-lines file to which every drive is added, and from which those already driven are taken.
    failures : path, optional
        Folder for scenario files of the drives that failed.
    training : mapping
        ``episodes`` and ``steps`` of the training data.
    trained_at : float, optional
        Slip at which models are learned; each at the slip that it drives at where not given.
    progress : callable
        Called with drives done and drives in all.

    Returns
    -------
    list of dict
        One record for each drive, by controller, family, slip and seed.

    Raises
    ------
    DataError
        For a records file that is not this study's.
    """
    seeds = range(first_seed, first_seed + maps)

    def learned_at(spec: Spec, slip: float) -> float | None:
        return None if spec.fit is None else float(slip if trained_at is None else trained_at)

    def key(spec: Spec, family: str, slip: float, seed: int) -> Key:
        return spec.label, family, learned_at(spec, slip), float(slip), seed

    cells = [(spec, family, slip) for spec in specs for family in families for slip in slips]
    wanted = {key(*cell, seed) for cell in cells for seed in seeds}
    done = {drive_key(r): r for r in _read(records) if drive_key(r) in wanted} if records is not None else {}
    progress(len(done), len(wanted))
    missing: list[tuple[Spec, str, float, list[int]]] = []
    for cell in cells:
        left = [seed for seed in seeds if key(*cell, seed) not in done]
        missing += [(*cell, left[i : i + CHUNK]) for i in range(0, len(left), CHUNK)]
    lessons = {}
    for spec, _, slip, _ in missing:
        lesson = learned_at(spec, slip), spec.fit
        if lesson not in lessons and lesson[0] is not None and lesson[1] is not None:
            lessons[lesson] = executor.submit(train, lesson[0], lesson[1], **training)
    models = {lesson: future.result() for lesson, future in lessons.items()}
    jobs = []
    for spec, family, slip, chunk in missing:
        lesson = learned_at(spec, slip), spec.fit
        model = models[lesson] if lesson in models else nominal_unicycle(DT)
        jobs.append(executor.submit(drive_maps, spec, model, lesson[0], family, slip, chunk))
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
        write_failures(results, failures)
    return results


def write_failures(records: Iterable[Record], folder: str | Path) -> list[Path]:
    """Write a scenario file for every drive that failed, and return their paths; ``kmpc simulate FILE`` drives it again."""
    target = Path(folder)
    paths = []
    for record in filter(failed, records):
        scenario = random_map(record["family"], record["seed"], record["slip"])
        what = "collision" if record["collision_s"] is not None else "not there"
        target.mkdir(parents=True, exist_ok=True)
        name = "-".join("".join(c if c.isalnum() else " " for c in record["controller"]).split())
        path = target / f"{scenario.name}-slip{record['slip']:g}-{name}.toml"
        path.write_text(f"# {record['controller']}: {what}\n{scenario.to_toml()}", encoding="utf-8")
        paths.append(path)
    return paths


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
            raise DataError(f"{source}: line {number}: expected a drive of a maps study, got {line[:60]!r}") from error
        records.append(record)
    return records
