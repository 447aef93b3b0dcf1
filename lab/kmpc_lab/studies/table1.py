"""``kmpc study table1``: the paper's table 1, its controllers beside ours, on any executor."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from kmpc_lab.sim.closed_loop import Outcome, drive
from kmpc_lab.studies.contenders import TABLE_1_CONTENDERS, Contender
from kmpc_lab.studies.records import Job, Record, Work
from kmpc_lab.studies.tables import seconds
from kmpc_lab.studies.training import DT, LAMBDAS, REPORTING_SEED, TRAINING, Teacher, train
from kmpc_lite.learn.regression import Method
from kmpc_lite.model.koopman import KoopmanModel
from kmpc_lite.scenario.files import Scenario

PaperCell = tuple[int, float | None, float | None]
"""Collisions of 5, mean duration of collision-free runs [s], mean time to collision [s]."""
PAPER_TABLE_1: dict[str, tuple[PaperCell, ...]] = {
    "paper: NMPC": (
        (0, 8.30, None),
        (1, 8.10, 6.84),
        (4, 8.98, 3.28),
        (5, None, 1.52),
        (5, None, 1.52),
        (5, None, 1.50),
        (5, None, 1.40),
        (5, None, 1.36),
    ),
    "paper: K-NMPC": (
        (0, 7.30, None),
        (0, 7.30, None),
        (1, 7.23, 3.20),
        (0, 7.05, None),
        (1, 6.94, 1.66),
        (1, 6.70, 1.60),
        (3, 6.55, 1.43),
        (1, 6.85, 1.47),
    ),
}
"""One cell for each of LAMBDAS."""


@dataclass(frozen=True)
class Cell:
    """One controller at one slip: the runs of all trials, as numbers."""

    label: str
    trained_at: float | None
    slip: float
    runs: tuple[dict[str, Any], ...]

    @property
    def elsewhere(self) -> float | None:
        """Slip of the training where it is another than the one driven at."""
        return None if self.trained_at == self.slip else self.trained_at

    @property
    def collisions(self) -> int:
        """How many runs collided."""
        return sum(r["outcome"] == Outcome.COLLISION.value for r in self.runs)

    def mean(self, key: str, collided: bool = False) -> float | None:
        """Mean of a number over the collision-free (or the collided) runs that have it."""
        values = [
            r[key]
            for r in self.runs
            if (r["outcome"] == Outcome.COLLISION.value) == collided and r[key] is not None
        ]
        return float(np.mean(values)) if values else None

    @property
    def arrived(self) -> int:
        """How many runs came within the scenario's tolerances of the goal, untouched."""
        return sum(
            r["outcome"] != Outcome.COLLISION.value and r["arrival_s"] is not None
            for r in self.runs
        )

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> Cell:
        """Cell of the plain values that `as_dict` gave."""
        runs = tuple(values["runs"])
        return cls(values["controller"], values["trained_at"], values["slip"], runs)

    def as_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return {
            "controller": self.label,
            "trained_at": self.trained_at,
            "slip": self.slip,
            "trials": len(self.runs),
            "collisions": self.collisions,
            "arrived": self.arrived,
            "mean_duration_s": self.mean("duration_s"),
            "mean_arrival_s": self.mean("arrival_s"),
            "mean_time_to_collision_s": self.mean("duration_s", collided=True),
            "runs": list(self.runs),
        }


@dataclass(frozen=True)
class Block:
    """One figure of the table, with a row for each controller."""

    title: str
    ours: Callable[[Cell], str]
    paper: Callable[[PaperCell], str] | None = None
    """None if the paper does not tell the figure."""


def _deepest_cut(cell: Cell) -> str:
    clearances = [run["clearance_m"] for run in cell.runs if run["clearance_m"] is not None]
    worst = min(clearances, default=0.0)
    return f"{-1e3 * worst:.0f}" if worst < 0 else "-"


BLOCKS = (
    Block("collisions / runs", lambda c: f"{c.collisions}/{len(c.runs)}", lambda p: f"{p[0]}/5"),
    Block("deepest cut into an obstacle [mm]", _deepest_cut),
    Block(
        "collision-free runs that came within 5 cm and 0.15 rad",
        lambda c: f"{c.arrived}/{len(c.runs) - c.collisions}",
    ),
    Block(
        "mean time of collision-free runs until there [s] (paper: until its own end)",
        lambda c: seconds(c.mean("arrival_s")),
        lambda p: seconds(p[1]),
    ),
    Block(
        "mean time to collision [s]",
        lambda c: seconds(c.mean("duration_s", collided=True)),
        lambda p: seconds(p[2]),
    ),
)


def format_table1(cells: Sequence[Cell]) -> str:
    """Render the cells beside the paper's figures, one block per figure, one row per controller."""
    lines = [_line("lambda", [f"{slip:g}" for slip in LAMBDAS])]
    rows: dict[tuple[str, float | None], dict[float, Cell]] = {}
    for cell in cells:
        rows.setdefault((cell.label, cell.elsewhere), {})[cell.slip] = cell
    for block in BLOCKS:
        lines += ["", block.title]
        if block.paper is not None:
            for name, figures in PAPER_TABLE_1.items():
                lines.append(_line(f"  {name}", [block.paper(figure) for figure in figures]))
        for (label, trained), row in rows.items():
            name = label if trained is None else f"{label}, trained at {trained:g}"
            texts = [block.ours(row[slip]) if slip in row else "" for slip in LAMBDAS]
            lines.append(_line(f"  {name}", texts))
    sums = []
    for label in dict.fromkeys(cell.label for cell in cells):
        own = [cell for cell in cells if cell.label == label and cell.elsewhere is None]
        runs = sum(len(cell.runs) for cell in own)
        sums.append(f"{label}: {sum(cell.collisions for cell in own)}/{runs}")
    total = ", ".join(["paper: NMPC: 30/40", "paper: K-NMPC: 7/40", *sums])
    return "\n".join([*lines, "", f"collisions in all: {total}"])


def _line(name: str, texts: Sequence[str]) -> str:
    return f"{name:<48}" + "".join(f"{text:>8}" for text in texts)


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
    work: Work,
    trials: int = 5,
    controllers: Sequence[Contender] = TABLE_1_CONTENDERS,
    lambdas: Sequence[float] = LAMBDAS,
    training: Mapping[str, int] = TRAINING,
) -> list[Cell]:
    """Run the paper's table 1 on a map.

    Train and drive at each slip, then train at 0.1 and drive at 0.15 and 0.2.

    Parameters
    ----------
    scenario : Scenario
        Map; its slip and seed are replaced.
    work : Work
        Does it.
    trials : int
        Runs for each slip and controller.
    controllers : sequence of Contender
        Rows.
    lambdas : sequence of float
        Slips.
    training : mapping
        ``episodes`` and ``steps`` of the training data.

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
    wanted: dict[CellKey, tuple[Contender, TableLesson | None, float]] = {}
    for spec, trained, slip in driven:
        need = TableLesson(trained, spec.fit) if spec.fit else None
        at = None if need is None else float(trained)
        wanted[spec.label, at, float(slip), trials, place] = (spec, need, slip)
    teacher = Teacher(work.executor, training)
    seeds = [REPORTING_SEED + i for i in range(trials)]

    def record(key: CellKey, runs: list[dict[str, Any]]) -> list[Record]:
        return [{**Cell(key[0], key[1], key[2], tuple(runs)).as_dict(), "map": place}]

    def jobs(missing: Sequence[CellKey]) -> Iterator[Job]:
        for key in missing:
            spec, need, slip = wanted[key]
            task = spec, teacher.model(need), replace(scenario, slip=slip), seeds, STOP_NORM
            yield work.executor.submit(run_trials, *task), partial(record, key)

    def lesson(key: CellKey) -> TableLesson | None:
        return wanted[key][1]

    done = work.finish(wanted, _key, "a cell of table 1", jobs, teacher, lesson)
    return [Cell.from_dict(cell) for cell in done]


def _key(record: Record) -> CellKey:
    """Identity of a cell: controller, slip of the training, slip, trials, and map."""
    trained = None if record["trained_at"] is None else float(record["trained_at"])
    size = int(record["trials"])
    return str(record["controller"]), trained, float(record["slip"]), size, str(record["map"])


def _digest(scenario: Scenario) -> str:
    """Name of a map by all that stands in it, whatever its file is called."""
    text = replace(scenario, slip=0.0, seed=0).to_toml()
    return hashlib.sha256(text.encode()).hexdigest()[:16]
