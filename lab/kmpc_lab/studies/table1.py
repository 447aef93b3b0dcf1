"""Study ``table1``: the paper's table 1, its controllers beside ours.

Trained and driven at each slip; then trained at 0.1 and driven at 0.15 and 0.2.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from kmpc_lab.sim.closed_loop import drive as drive_scenario
from kmpc_lab.studies import maps
from kmpc_lab.studies.contenders import DT, EVERYTHING
from kmpc_lab.studies.drive import DriveResult
from kmpc_lab.studies.maps import CONDITIONS, CONTROLLERS, model_of, result_of
from kmpc_lab.studies.table import Rows
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
"""One cell for each slip."""
ELSEWHERE = " trained at "  # between the slip that is driven at and another one that is learned at
STOP_NORM = 1e-2  # the paper's end of a run: ``|x - x_ref|`` over the whole state


def prepare(values: Sequence[Sequence[object]]) -> None:
    """Build each controller, as `maps.prepare` does."""
    maps.prepare((values[0], ("plain",), ("open",)))


class Block(NamedTuple):
    """One figure of the table, with a row for each controller."""

    title: str
    ours: Callable[[Rows], str]
    paper: Callable[[PaperCell], str] | None = None  # none if the paper does not tell the figure


def drive(label: str, slip: str, map_name: str, seed: int) -> DriveResult:
    """Drive one trial of a cell."""
    at, _, trained = slip.partition(ELSEWHERE)
    spec = CONTROLLERS[label]
    scenario = replace(Scenario.load(map_name), slip=float(at), seed=seed)
    model = model_of(CONDITIONS["plain"], float(trained or at), spec.fit)
    run = drive_scenario(spec.build(model, scenario), scenario, dt=DT, stop_norm=STOP_NORM)
    return replace(result_of(run), peer=label != EVERYTHING.label)


def seconds(values: Sequence[float | None]) -> str:
    """Tell a mean time [s]; a dash if there is none."""
    found = [value for value in values if value is not None]
    return f"{np.mean(found):.2f}" if found else "-"


def deepest_cut(rows: Rows) -> str:
    """How deep the worst drive cuts into an obstacle [mm]."""
    worst = min(row.clearance for row in rows)
    return f"{-1e3 * worst:.0f}" if worst < 0 else "-"


def collisions(rows: Rows) -> int:
    """How many drives collided."""
    return sum(row.collided for row in rows)


BLOCKS = (
    Block("collisions / runs", lambda c: f"{collisions(c)}/{len(c)}", lambda p: f"{p[0]}/5"),
    Block("deepest cut into an obstacle [mm]", deepest_cut),
    Block(
        "collision-free runs that came within 5 cm and 0.15 rad",
        lambda c: f"{sum(row.arrived for row in c)}/{len(c) - collisions(c)}",
    ),
    Block(
        "mean time of collision-free runs until there [s] (paper: until its own end)",
        lambda c: seconds([row.seconds for row in c if row.arrived]),
        lambda p: seconds([p[1]]),
    ),
    Block(
        "mean time to collision [s]",
        lambda c: seconds([row.seconds for row in c if row.collided]),
        lambda p: seconds([p[2]]),
    ),
)


def render(rows: Rows) -> str:
    """Rows beside the paper's figures, one block per figure, one row per controller."""
    cells: dict[tuple[str, str], list[DriveResult]] = {}
    for row in rows:
        cells.setdefault((row.axes[0], row.axes[1]), []).append(row)
    labels, slips = (list(dict.fromkeys(key[i] for key in cells)) for i in (0, 1))
    here = [slip for slip in slips if ELSEWHERE not in slip]
    lines = [_line("lambda", here)]
    for block in BLOCKS:
        lines += ["", block.title]
        if block.paper is not None and len(here) == len(next(iter(PAPER_TABLE_1.values()))):
            for name, figures in PAPER_TABLE_1.items():
                lines.append(_line(f"  {name}", [block.paper(figure) for figure in figures]))
        for label in labels:
            own = {slip: block.ours(cells[label, slip]) for slip in slips}
            lines.append(_line(f"  {label}", [own[slip] for slip in here]))
            learned = CONTROLLERS[label].fit is not None
            lines += [f"    {slip}: {own[slip]}" for slip in slips if learned and ELSEWHERE in slip]
    sums = [
        f"{label}: {collisions(own)}/{len(own)}"
        for label in labels
        for own in [[row for slip in here for row in cells[label, slip]]]
    ]
    total = ", ".join(["paper: NMPC: 30/40", "paper: K-NMPC: 7/40", *sums])
    return "\n".join([*lines, "", f"collisions in all: {total}"])


def _line(name: str, texts: Sequence[str]) -> str:
    return f"{name:<48}" + "".join(f"{text:>8}" for text in texts)
