"""Failures of a study are files by which they can be driven again."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from executors import Inline
from map_studies import RAM, Spec, study
from scripted import Scripted

import kmpc_lite as kl
from kmpc_lab import drive
from kmpc_lab.sim.closed_loop import Run
from kmpc_lab.studies.conditions import PLAIN, Condition
from kmpc_lab.studies.contenders import STUDY_CONTENDERS, TABLE_1_CONTENDERS, Contender
from kmpc_lab.studies.failures import check_folder, failed, write_failures
from kmpc_lite.scenario.files import Scenario


def test_a_failure_is_a_scenario_file_that_replays_it(tmp_path: Path) -> None:
    found = study(specs=[RAM], slips=(0.0,), maps=5, failures=tmp_path / "failed")
    collided = [r for r in found if r["collision_s"] is not None]
    assert collided
    files = sorted((tmp_path / "failed").glob("*.toml"))
    assert len(files) == sum(failed(r) for r in found)
    for record in collided:
        (path,) = (f for f in files if f.name.startswith(f"open-{record['seed']}-slip0-ram"))
        scenario = Scenario.load(path)
        first = path.read_text().splitlines()[0]
        assert first == "# ram: collision; cannot be driven again by kmpc simulate"
        again = drive(Scripted((0.6, 0.0)), scenario)
        assert again.outcome.value == "collision" and again.duration == record["collision_s"]


def test_where_failures_or_records_cannot_be_written_nothing_is_driven(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    executor = Inline()
    for folder in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(NotADirectoryError, match="file"):
            study(executor, failures=folder)
    with pytest.raises(OSError, match="none"):
        study(executor, records=tmp_path / "none" / "drives.jsonl")
    with pytest.raises(IsADirectoryError):
        study(executor, records=tmp_path)
    assert not executor.asked
    check_folder(tmp_path / "a" / "new" / "one")
    assert not (tmp_path / "a").exists()


def test_a_failure_of_a_learned_model_leaves_the_model_too(tmp_path: Path) -> None:
    spec = Spec("a", "stand", fit="integral", simulate_words=())
    options: dict[str, Any] = {
        "specs": [spec],
        "slips": (0.1,),
        "maps": 2,
        "records": tmp_path / "drives.jsonl",
    }
    study(**options)
    # also of drives that were done before
    study(**options, failures=tmp_path / "failed")
    (model,) = (tmp_path / "failed").glob("*.npz")
    found = sorted((tmp_path / "failed").glob("*.toml"))
    assert len(found) == 2
    for path in found:
        first = path.read_text().splitlines()[0]
        assert first == f"# a: not there; kmpc simulate --scenario {path.name} --model {model.name}"
    assert kl.KoopmanModel.load(model).info["method"] == "integral"


def test_a_failure_is_driven_again_by_the_command_in_its_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from kmpc_lite.cli.main import main

    spec = Contender("ours, no adaptation", fit=None, adaptation=False)
    late = Condition("late", lag=1.5, dead_time=1.0, pose_age=0.2)
    # a model that knows no lag drives a robot that lags: it hits things
    found = study(
        specs=[spec], slips=(0.0,), maps=1, first_seed=3, conditions=(late,), failures=tmp_path
    )
    record = next(r for r in found if r["collision_s"] is not None)
    (file,) = tmp_path.glob(f"open-{record['seed']}-*.toml")
    words = file.read_text().splitlines()[0].partition("; kmpc ")[2].split()
    monkeypatch.chdir(tmp_path)
    assert main([*words, "-o", "run.npz"]) == 1
    run = Run.load("run.npz")
    assert run.outcome.value == "collision" and run.duration == record["collision_s"]


@pytest.mark.parametrize(
    ("contender", "told"),
    [
        (STUDY_CONTENDERS[-2], "kmpc simulate --scenario {name} --model {model}"),
        (STUDY_CONTENDERS[-1], "kmpc simulate --scenario {name} --model {model} --no-adaptation"),
        (
            Contender("careful", margin=0.02),
            "kmpc simulate --scenario {name} --model {model} --margin 0.02",
        ),
        (Contender("always", adaptation=True), "cannot be driven again by kmpc simulate"),
        (Contender("daqp", solver="daqp"), "cannot be driven again by kmpc simulate"),
        *((peer, "cannot be driven again by kmpc simulate") for peer in TABLE_1_CONTENDERS[:-1]),
    ],
    ids=lambda value: value.label if isinstance(value, Contender) else "",
)
def test_a_failure_names_a_command_only_where_it_drives_the_same_controller(
    tmp_path: Path, contender: Contender, told: str
) -> None:
    record = {
        "controller": contender.label,
        "family": "open",
        "condition": "",
        "trained_at": None,
        "slip": 0.0,
        "seed": 3,
        "collision_s": None,
        "pose_s": None,
    }
    drives = [(record, contender, PLAIN, kl.nominal_unicycle(0.1))]
    (file,) = write_failures(drives, tmp_path)
    (model,) = tmp_path.glob("*.npz")
    first = file.read_text().splitlines()[0]
    again = told.format(name=file.name, model=model.name)
    assert first == f"# {contender.label}: not there; {again}"
