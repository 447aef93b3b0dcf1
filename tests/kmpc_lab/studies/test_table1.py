"""Table 1: the right cells from any executor, and the paper's figures beside them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from executors import Inline
from scripted import Scripted, field

import kmpc_lite as kl
from kmpc_lab import Outcome, drive
from kmpc_lab.studies.contenders import TABLE_1_CONTENDERS, Contender
from kmpc_lab.studies.records import Work
from kmpc_lab.studies.table1 import Cell, format_table1, run_trials, table1
from kmpc_lab.studies.training import DT, LAMBDAS, train
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


def test_every_controller_meets_the_same_floors() -> None:
    cells = table1(small_map(), Work(Inline()), 3, (OURS, LEARNED), (0.1,), SMALL)
    seeds = [[r["seed"] for r in c.runs] for c in cells]
    assert all(s == seeds[0] for s in seeds)
    assert len(set(seeds[0])) == 3
    assert min(seeds[0]) >= 500_000  # none that anything was tuned on


def test_training_is_the_papers_at_one_slip() -> None:
    model = train(0.05, "edmdc", 5, 40)
    assert model.info["method"] == "edmdc" and model.info["samples"] == 200
    assert model.dt == DT
    np.testing.assert_array_equal(model.A, train(0.05, "edmdc", 5, 40).A)
    assert np.abs(model.A - train(0.1, "edmdc", 5, 40).A).max() > 1e-6


def test_trials_are_drives_of_the_scenario_with_each_seed() -> None:
    scenario = replace(small_map(), slip=0.1)
    results = run_trials(OURS, kl.nominal_unicycle(0.1), scenario, [7, 8], 1e-2)
    for seed, result in zip((7, 8), results, strict=True):
        controller = kl.Controller(
            kl.nominal_unicycle(0.1), replace(scenario.problem(), margin=0.02)
        )
        run = drive(controller, replace(scenario, seed=seed), stop_norm=1e-2)
        assert result["seed"] == seed
        assert (result["outcome"], result["duration_s"]) == (run.outcome.value, run.duration)
        assert result["clearance_m"] == pytest.approx(run.clearance, abs=1e-3)
        assert result["arrival_s"] == run.arrival


def test_the_five_rows_of_the_table_can_be_built() -> None:
    assert len({s.label for s in TABLE_1_CONTENDERS}) == len(TABLE_1_CONTENDERS)
    rows = {(s.form == "ipopt", s.fit) for s in TABLE_1_CONTENDERS}
    # the paper's two, and ours with the paper's fit and with the other
    assert rows >= {(True, None), (True, "edmdc"), (False, "edmdc"), (False, "integral")}
    pytest.importorskip("casadi", reason="needs the extra peers")
    for spec in TABLE_1_CONTENDERS:
        assert (
            spec.build(kl.nominal_unicycle(0.1), small_map())
            .step((0.0, 0.0, 0.0), (0.6, 0.0, 0.0))
            .command[0]
            > 0.0
        )


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


def test_arrival_is_the_first_time_within_the_tolerances() -> None:
    there = [(0.5, 0.0)] * 20 + [(0.0, 0.0)]
    assert drive(Scripted(*there), field(), stop_norm=1e-6).arrival == pytest.approx(1.9)
    # right through it, and out again
    assert drive(Scripted((0.5, 0.0)), field(), stop_norm=1e-6).arrival == pytest.approx(1.9)
    assert drive(Scripted((0.5, 0.2)), field(), stop_norm=1e-6).arrival is None


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
