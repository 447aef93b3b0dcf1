"""Conditions that a study drives its maps in: robots that lag, and floors that change."""

from pathlib import Path

from executors import Inline
from map_studies import RAM, STAND, study

from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.conditions import (
    PLAIN,
    Condition,
)
from kmpc_lab.studies.tables import format_maps, summarise


def test_conditions_are_driven_and_distinguished(tmp_path: Path) -> None:
    late, path = (
        Condition("late", lag=0.2, dead_time=0.1, pose_noise=(0.01, 0.01, 0.0), pose_age=0.1),
        tmp_path / "drives.jsonl",
    )
    found = study(specs=[RAM, STAND], slips=(0.1,), maps=2, conditions=(PLAIN, late), records=path)
    assert [(r["controller"], r["condition"], r["seed"]) for r in found] == [
        (c, name, seed) for c in ("ram", "stand") for name in ("", "late") for seed in (100, 101)
    ]
    assert (
        study(
            Inline(stop_after=0),
            specs=[RAM, STAND],
            slips=(0.1,),
            maps=2,
            conditions=(PLAIN, late),
            records=path,
        )
        == found
    )
    scenario = late.apply(random_map("open", 100, 0.1))
    assert (scenario.lag, scenario.dead_time, scenario.pose_noise, scenario.pose_age) == (
        0.2,
        0.1,
        (0.01, 0.01, 0.0),
        0.1,
    )
    assert scenario.name == "open-100-late" and PLAIN.apply(scenario) is scenario
    rows = summarise(found)
    assert [(r.controller, r.condition, r.drives) for r in rows] == [
        (c, n, 2) for c in ("ram", "stand") for n in ("", "late")
    ]
    assert (
        "late" in format_maps(rows).splitlines()[2]
        and "condition" in format_maps(rows).splitlines()[0]
    )
    assert "condition" not in format_maps(rows[:1])
