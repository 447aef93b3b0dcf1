"""Conditions that a study drives its maps in: robots that lag, and floors that change."""

from pathlib import Path

import numpy as np
from executors import Inline
from map_studies import RAM, STAND, study

import kmpc_lab
import kmpc_lite as kl
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.conditions import (
    BOTH_CHANGE,
    LAGGING,
    PLAIN,
    Condition,
)
from kmpc_lab.studies.contenders import Contender
from kmpc_lab.studies.random_maps import drive_maps
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


def test_a_model_is_judged_on_the_floor_that_the_robot_came_to() -> None:
    learning = kl.fit(
        kmpc_lab.generate_dataset(kmpc_lab.DifferentialDrive(), episodes=20, steps=50)
    )
    specs = [
        Contender("off", adaptation=False),
        Contender("on", adaptation=True),
    ]
    # a single short drive may teach little
    seeds = [3, 4, 5]
    off, on = (drive_maps(s, learning, 0.0, BOTH_CHANGE, "open", 0.0, seeds) for s in specs)
    with_it, without = (np.median([r["error_ratio"] for r in drives]) for drives in (on, off))
    assert with_it < 0.5 * without
    rows = summarise([*off, *on])
    assert rows[0].error_ratio is not None and rows[1].error_ratio is not None
    assert "to a fresh fit's" in format_maps(rows)
    # nothing is reported of a controller without a model, or where the floor did not change
    assert drive_maps(STAND, learning, 0.0, BOTH_CHANGE, "open", 0.0, [3])[0]["error_ratio"] is None
    assert "error_ratio" not in drive_maps(STAND, learning, 0.0, LAGGING, "open", 0.0, [3])[0]
