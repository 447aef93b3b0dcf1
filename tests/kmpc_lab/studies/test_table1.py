"""Table 1: the right cells from any executor, and the paper's figures beside them."""

from dataclasses import replace
from typing import Any

import pytest
from executors import Inline

from kmpc_lab import Outcome
from kmpc_lab.studies.contenders import Contender
from kmpc_lab.studies.records import Work
from kmpc_lab.studies.table1 import Cell, format_table1, table1
from kmpc_lab.studies.training import LAMBDAS
from kmpc_lite.scenario.files import Scenario

OURS = Contender("ours", fit=None, margin=0.02)
LEARNED = Contender("learned", "paper", margin=0.02)
SMALL = {"episodes": 6, "steps": 30}


def small_map() -> Scenario:
    return replace(Scenario.load("mehrez"), goal=(0.6, 0.0, 0.0), timeout=3.0)


def test_cells_are_by_controller_then_slip_then_generalisation() -> None:
    done: list[tuple[int, int]] = []
    executor = Inline()
    cells = table1(
        small_map(),
        Work(executor, lambda k, n: done.append((k, n))),
        2,
        (OURS, LEARNED),
        (0.0, 0.1),
        SMALL,
    )
    assert [(c.label, c.trained_at, c.slip) for c in cells] == [
        ("ours", None, 0.0),
        ("ours", None, 0.1),
        ("learned", 0.0, 0.0),
        ("learned", 0.1, 0.1),
        ("learned", 0.1, 0.15),
        ("learned", 0.1, 0.2),
    ]
    assert all(len(c.runs) == 2 for c in cells)
    # each model is trained once: at 0 and at 0.1
    assert executor.names == ["learn"] * 2 + ["run_trials"] * 6
    assert done == [(k, 8) for k in range(9)]


def result(
    outcome: Outcome, duration: float, arrival: float | None = None, clearance: float = 0.1
) -> dict[str, Any]:
    return {
        "outcome": outcome.value,
        "duration_s": duration,
        "arrival_s": arrival,
        "clearance_m": clearance,
        "seed": 0,
    }


def test_a_cell_counts_and_averages() -> None:
    runs = (
        result(Outcome.REACHED, 5.0, 4.0),
        result(Outcome.TIMEOUT, 20.0, 6.0),
        result(Outcome.TIMEOUT, 20.0, None),
        result(Outcome.COLLISION, 1.0, None, -0.01),
        result(Outcome.COLLISION, 2.0, 1.5, -0.02),
    )
    cell = Cell("x", 0.1, 0.15, runs)
    assert (cell.collisions, cell.arrived) == (2, 2)
    assert cell.mean("duration_s") == pytest.approx(15.0)
    assert cell.mean("arrival_s") == pytest.approx(5.0)
    assert cell.mean("duration_s", collided=True) == pytest.approx(1.5)
    assert Cell("x", None, 0.0, runs[:1]).mean("duration_s", collided=True) is None
    plain = cell.as_dict()
    assert plain["trials"] == 5 and plain["collisions"] == 2 and len(plain["runs"]) == 5


def cells_of(label: str, trained: bool, collisions: int) -> list[Cell]:
    runs = tuple(
        result(Outcome.COLLISION, 1.23, None, -0.004)
        if i < collisions
        else result(Outcome.REACHED, 7.0, 6.54)
        for i in range(5)
    )
    made = [Cell(label, slip if trained else None, slip, runs) for slip in LAMBDAS]
    return made + [Cell(label, 0.1, slip, runs) for slip in (0.15, 0.2) if trained]


def test_the_table_holds_the_papers_figures_and_ours_side_by_side() -> None:
    text = format_table1(cells_of("mine", True, 2) + cells_of("theirs", False, 0))
    lines = [" ".join(line.split()) for line in text.splitlines()]
    assert "lambda 0 0.01 0.03 0.05 0.07 0.1 0.15 0.2" in lines
    assert "paper: NMPC 0/5 1/5 4/5 5/5 5/5 5/5 5/5 5/5" in lines
    assert "paper: K-NMPC 0/5 0/5 1/5 0/5 1/5 1/5 3/5 1/5" in lines
    assert "paper: NMPC 8.30 8.10 8.98 - - - - -" in lines
    assert "paper: K-NMPC 7.30 7.30 7.23 7.05 6.94 6.70 6.55 6.85" in lines
    assert "paper: NMPC - 6.84 3.28 1.52 1.52 1.50 1.40 1.36" in lines
    assert "paper: K-NMPC - - 3.20 - 1.66 1.60 1.43 1.47" in lines
    assert "mine" + " 2/5" * 8 in lines
    assert "theirs" + " 0/5" * 8 in lines
    assert "mine, trained at 0.1 2/5 2/5" in lines
    assert "mine" + " 4" * 8 in lines  # millimetres of the deepest cut
    assert "mine" + " 6.54" * 8 in lines
    assert "mine" + " 1.23" * 8 in lines
    assert lines[-1].endswith("paper: NMPC: 30/40, paper: K-NMPC: 7/40, mine: 16/40, theirs: 0/40")
    # the generalisation rows stand under their own slips
    row = next(line for line in text.splitlines() if "trained at" in line)
    heading = text.splitlines()[0]
    assert row.index("2/5") + 3 == heading.index("0.15") + 4
