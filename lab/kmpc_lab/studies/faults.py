"""``kmpc study faults``: closed loops with forced failures.

The solver, the clock, the warm start or the pose fails again and again.

Each drive has one kind of failure, in bursts of random length between stretches of sane steps.
Counted are collisions (at four sub-samples), whether the robot was stopped within the stop
trajectory that was verified before, whether a plan was found within a second of sane inputs, and
whether the command was zero after three seconds without a usable pose.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, fields, replace

from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.faulty_loop import KINDS, FaultCounts, FaultyLoop
from kmpc_lab.studies.records import Job, Record, Work
from kmpc_lab.studies.table1 import TableLesson
from kmpc_lab.studies.training import DT, REPORTING_SEED, TRAINING, Teacher
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

FaultsKey = tuple[str, float, int, int, tuple[str, ...]]
"""Kind of failure, slip, maps of each family, first seed, families."""
SLIPS = (0.05, 0.2)
FAMILIES = ("dense", "narrow", "moving")
FIXED = tuple(f"four_circles_{i}" for i in range(1, 5))


def drive_faults(
    kind: str, slip: float, model: KoopmanModel, scenarios: Sequence[Scenario]
) -> FaultCounts:
    """Drive scenarios with one kind of failure; this is what a worker does."""
    counts = FaultCounts(kind, slip)
    for scenario in scenarios:
        loop = FaultyLoop(model, scenario, kind, counts)
        run = drive(loop, scenario, dt=DT)
        counts.drives += 1
        # a collision ends the drive
        counts.collisions += run.outcome is Outcome.COLLISION
        counts.collisions_failing += run.outcome is Outcome.COLLISION and loop.failing
        counts.arrived += run.outcome is Outcome.REACHED
    return counts


def faults_study(
    work: Work,
    maps: int = 5,
    slips: Sequence[float] = SLIPS,
    families: Sequence[str] = FAMILIES,
    first_seed: int = REPORTING_SEED,
    training: Mapping[str, int] = TRAINING,
) -> list[FaultCounts]:
    """Drive every kind of failure over the maps of four circles and random ones, at every slip.

    Parameters
    ----------
    work : Work
        Does it.
    maps : int
        Random maps of each family.
    slips, families : sequence
        Of the plant; of `maps.FAMILIES`.
    first_seed : int
        The first map's.
    training : mapping
        ``episodes`` and ``steps`` of the training data.

    Returns
    -------
    list of FaultCounts
        One for each kind and slip.
    """
    driven = {"maps": maps, "first_seed": first_seed, "families": list(families)}
    wanted = [
        (kind, float(slip), maps, first_seed, tuple(families)) for slip in slips for kind in KINDS
    ]
    teacher = Teacher(work.executor, training)

    def lesson(key: FaultsKey) -> TableLesson:
        return TableLesson(key[1], "integral")

    def jobs(missing: Sequence[FaultsKey]) -> Iterator[Job]:
        for key in missing:
            kind, slip = key[:2]
            scenarios = _scenarios(slip, families, maps, first_seed)
            task = kind, slip, teacher.model(lesson(key)), scenarios
            started = work.executor.submit(drive_faults, *task)
            yield started, lambda counts: [{**asdict(counts), **driven}]

    done = work.finish(wanted, _key, "a row of a faults study", jobs, teacher, lesson)
    return [_counts(row) for row in done]


def _scenarios(slip: float, families: Sequence[str], maps: int, first_seed: int) -> list[Scenario]:
    """Maps of every kind of failure: fixed ones, then random ones."""
    scenarios = [
        replace(Scenario.load(name), slip=slip, seed=first_seed + i) for i, name in enumerate(FIXED)
    ]
    for family in families:
        scenarios += [random_map(family, first_seed + i, slip) for i in range(maps)]
    return scenarios


def _key(row: Record) -> FaultsKey:
    """Identity of a row: kind of failure, slip, and the maps that were driven."""
    kind, slip = str(row["kind"]), float(row["slip"])
    return kind, slip, int(row["maps"]), int(row["first_seed"]), tuple(row["families"])


def _counts(row: Record) -> FaultCounts:
    """Counts of a record."""
    # records of before know nothing of what was counted later
    return FaultCounts(
        **{field.name: row.get(field.name, field.default) for field in fields(FaultCounts)}
    )


def format_faults(rows: Sequence[FaultCounts]) -> str:
    """Table of the counts, and their sums."""
    columns = {
        "drives": "drives",
        "steps": "steps",
        "failing": "failed_steps",
        "fallback": "fallback",
        "stopped": "stopped",
        "collisions": "collisions",
        "of failing": "collisions_failing",
        "late stop": "late_stops",
        "late plan": "late_recoveries",
        "blind": "blind_steps",
        "arrived": "arrived",
    }
    lines = [f"{'failure':30}{'slip':>6}" + "".join(f"{h:>11}" for h in columns)]
    for row in rows:
        lines.append(
            f"{row.kind:30}{row.slip:6g}"
            + "".join(f"{getattr(row, c):11d}" for c in columns.values())
        )
    total = {c: sum(getattr(row, c) for row in rows) for c in columns.values()}
    lines.append(f"{'all':36}" + "".join(f"{total[c]:11d}" for c in columns.values()))
    lines.append(
        "of failing: collisions in a period whose step was made to fail; "
        "late stop: steps driven past the end of the stop trajectory; late plan: "
        "none within 1 s of sane inputs; "
        "blind: commands other than zero after 3 s without a pose"
    )
    return "\n".join(lines)
