"""The study over random maps: complete, resumable, and its numbers those of the drives."""

import json
from pathlib import Path
from typing import Any

import pytest
from executors import Inline
from map_studies import Spec, study


@pytest.fixture(scope="module")
def records() -> list[dict[str, Any]]:
    return study()


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
