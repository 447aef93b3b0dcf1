"""The study over random maps: complete, resumable, and its numbers those of the drives."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from executors import Inline
from map_studies import FOLLOW, STAND, Spec, study

import kmpc_lite as kl
from kmpc_lab import drive
from kmpc_lab.sim.maps.families import random_map
from kmpc_lab.studies.failures import failed
from kmpc_lab.studies.random_maps import SETTLE, measure


@pytest.fixture(scope="module")
def records() -> list[dict[str, Any]]:
    return study()


def test_every_controller_drives_every_map_at_every_slip(records: list[dict[str, Any]]) -> None:
    seen = [(r["controller"], r["family"], r["slip"], r["seed"]) for r in records]
    assert seen == [
        (c, "open", s, 100 + i)
        for c in ("follow", "stand", "ram")
        for s in (0.0, 0.1)
        for i in range(2)
    ]


def test_a_record_says_what_the_drive_was(records: list[dict[str, Any]]) -> None:
    for record in records:
        if record["controller"] == "stand":
            assert failed(record) and record["collision_s"] is None and record["settled_s"] is None
    scenario = random_map("open", 101, 0.1)
    run = drive(FOLLOW.build(kl.nominal_unicycle(0.1), scenario), scenario, settle=SETTLE)
    record = next(
        r for r in records if (r["controller"], r["slip"], r["seed"]) == ("follow", 0.1, 101)
    )
    fresh = measure(run, "open", "follow", None)
    assert {k: v for k, v in record.items() if "step" not in k} == {
        k: v for k, v in fresh.items() if "step" not in k
    }
    assert (
        record["clearance_m"] == run.clearance and record["position_error_m"] == run.position_error
    )
    assert record["position_s"] <= record["pose_s"] <= record["settled_s"] - SETTLE + 0.11


def test_an_interrupted_study_goes_on_where_it_ended(
    tmp_path: Path, records: list[dict[str, Any]]
) -> None:
    path = tmp_path / "drives.jsonl"
    with pytest.raises(RuntimeError, match="worker died"):
        study(Inline(stop_after=3), records=path)
    kept = [json.loads(line) for line in path.read_text().splitlines()]
    # all that was driven is there
    assert len(kept) == 3 * 2 < len(records)
    # the process was killed while it wrote
    path.write_text(path.read_text() + '{"controller": "fol')
    progress: list[tuple[int, int]] = []
    executor = Inline()
    again = study(
        executor, records=path, progress=lambda done, total: progress.append((done, total))
    )
    untimed = [{k: v for k, v in r.items() if "step" not in k} for r in again]
    assert untimed == [{k: v for k, v in r.items() if "step" not in k} for r in records]
    assert progress[0] == (len(kept), 12) and progress[-1] == (12, 12)
    assert sum(len(args[-1]) for name, args in executor.asked if name == "drive_maps") == 12 - len(
        kept
    )
    assert len(path.read_text().splitlines()) == 12
    idle = Inline()
    assert study(idle, records=path) == again and not idle.asked


def test_more_maps_are_added_to_those_that_are_there(tmp_path: Path) -> None:
    path = tmp_path / "drives.jsonl"
    first = study(specs=[STAND], slips=(0.0,), maps=2, records=path)
    executor = Inline()
    more = study(executor, specs=[STAND], slips=(0.0,), maps=5, records=path)
    assert more[:2] == first and len(more) == 5
    assert [args[-1] for _, args in executor.asked] == [[102, 103, 104]]


def test_models_are_learned_once_for_each_slip_and_only_where_needed() -> None:
    learning = [
        Spec("a", "stand", fit="integral"),
        Spec("b", "stand", fit="integral"),
        Spec("c", "stand", fit="edmdc"),
    ]
    executor = Inline()
    found = study(executor, specs=learning, maps=1, slips=(0.0, 0.05))
    assert executor.names.count("learn") == 4  # two slips, two methods
    assert {(r["slip"], r["trained_at"]) for r in found} == {(0.0, 0.0), (0.05, 0.05)}
    elsewhere = Inline()
    mismatched = study(elsewhere, specs=learning[:1], maps=1, slips=(0.1, 0.2), trained_at=0.05)
    assert elsewhere.names.count("learn") == 1
    assert {r["trained_at"] for r in mismatched} == {0.05}


def test_a_drive_with_another_training_is_another_drive(tmp_path: Path) -> None:
    path, spec = tmp_path / "drives.jsonl", [Spec("a", "stand", fit="integral")]
    study(specs=spec, maps=1, slips=(0.1,), records=path)
    executor = Inline()
    study(executor, specs=spec, maps=1, slips=(0.1,), records=path, trained_at=0.0)
    assert [name for name, _ in executor.asked] == ["learn", "drive_maps"]
    assert len(path.read_text().splitlines()) == 2
