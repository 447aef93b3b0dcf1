"""Failures of a study are files by which they can be driven again."""

from pathlib import Path

import pytest
from map_studies import RAM, study
from scripted import Scripted

import kmpc_lite as kl
from kmpc_lab import drive
from kmpc_lab.studies.conditions import PLAIN
from kmpc_lab.studies.contenders import STUDY_CONTENDERS, TABLE_1_CONTENDERS, Contender
from kmpc_lab.studies.failures import failed, write_failures
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
